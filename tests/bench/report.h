/* Output of the benchmark: lines on stdout, and rows in a JSON file if a path is given. */
#ifndef BENCH_REPORT_H
#define BENCH_REPORT_H

#include "json.h"

struct report {
    struct json json;
    int missed; /* targets */
};

/* What a figure must be. */
enum comparison { NO_TARGET, AT_MOST, AT_LEAST };
struct target {
    enum comparison comparison;
    double limit;
};

/* Opens the file, if path is not NULL, with an object that holds the machine and the repeats. */
void report_open(struct report *report, const char *path, int repeats);
void report_close(struct report *report);

/* A row of the file: which measurement, of what work, done by whom. Its numbers follow. */
void report_row(struct report *report, const char *group, const char *work, const char *run);
void report_number(struct report *report, const char *name, double value);
void report_row_end(struct report *report);

/* A number that has a target: also prints the target and whether it is reached. */
void report_judged(struct report *report, const char *name, double value, struct target target);

#endif
