/* The main of all programs with Unity tests. */
#include "each_method.h"
#include "integrator.h"
#include "test_list.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

int method;

#define METHOD_NAME(code, symbol) [code] = #code,
static const char *const method_names[] = {INTEGRATOR_METHOD_LIST(METHOD_NAME)};
#undef METHOD_NAME

// a file defines those that it needs
__attribute__((weak)) void suiteSetUp(void) {}

__attribute__((weak)) int suiteTearDown(int failures) {
    return failures;
}

__attribute__((weak)) void setUp(void) {}

__attribute__((weak)) void tearDown(void) {}

static bool is_cvode(void) {
    return method == INTEGRATOR_CVODE_ADAMS || method == INTEGRATOR_CVODE_BDF;
}

/* text: part of the names of the tests to run. */
static void run(const struct test *test, const char *name, const char *text) {
    if (strstr(name, text) != NULL) {
        UnityDefaultTestRun(test->run, name, test->line);
    }
}

static void run_with_methods(const struct test *test, const char *text) {
    for (method = INTEGRATOR_NO_METHOD + 1; method < INTEGRATOR_METHODS; method++) {
        if (test->kind == TEST_EACH_METHOD || is_cvode()) {
            char name[256];
            snprintf(name, sizeof name, "%s(%s)", test->name, method_names[method]);
            run(test, name, text);
        }
    }
}

int main(int argc, char **argv) {
    if (argc > 2) {
        fprintf(stderr, "usage: %s [TEXT]; TEXT: part of the names of the tests to run\n", argv[0]);
        return 2;
    }
    const char *text = argc == 2 ? argv[1] : "";
    suiteSetUp();
    UnityBegin(test_file);
    for (unsigned i = 0; i < test_count; i++) {
        if (test_list[i].kind == TEST_ONCE) {
            run(&test_list[i], test_list[i].name, text);
        } else {
            run_with_methods(&test_list[i], text);
        }
    }
    if (Unity.NumberOfTests == 0) {
        fprintf(stderr, "no test of %s has a name with %s\n", test_file, text);
        return 2;
    }
    return suiteTearDown(UnityEnd());
}
