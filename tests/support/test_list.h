/* The tests of a program. list_tests.py writes the list, test_main.c runs it. Includes nothing: it
 * stands in front of what a test file defines before its first header. */
#ifndef TEST_LIST_H
#define TEST_LIST_H

enum test_kind {
    TEST_ONCE,
    TEST_EACH_METHOD,
    TEST_EACH_CVODE_METHOD,
};

struct test {
    const char *name;
    void (*run)(void);
    int line;
    enum test_kind kind;
};

extern const char test_file[]; /* its path */
extern const struct test test_list[];
extern const unsigned test_count;

#endif
