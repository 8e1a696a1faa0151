#include "bench.h"

#include <math.h>
#include <sundials/sundials_config.h>

#ifdef __clang__
#define COMPILER "clang " __clang_version__
#else
#define COMPILER "gcc " __VERSION__
#endif

void report_open(struct report *report, int repeats) {
    report->has_rows = false;
    printf("{\"machine\": {\"compiler\": \"%s\", \"sundials\": \"%s\", \"MuJoCo\": \"%s\"},\n",
           COMPILER, SUNDIALS_VERSION, mujoco_version());
    printf("\"repeats\": %d, \"rows\": [", repeats);
}

void report_close(struct report *report) {
    (void)report;
    printf("\n]}\n");
    require(fflush(stdout) == 0, "the figures cannot be written");
}

void report_row(struct report *report, const char *group, const char *work, const char *run) {
    printf("%s\n{\"group\": \"%s\", \"work\": \"%s\", \"run\": \"%s\"", report->has_rows ? "," : "",
           group, work, run);
    report->has_rows = true;
}

void report_number(struct report *report, const char *name, double value) {
    (void)report;
    require(isfinite(value), "a figure is not finite");
    printf(", \"%s\": %.17g", name, value);
}

void report_row_end(struct report *report) {
    (void)report;
    putchar('}');
}

void report_judged(struct report *report, const char *name, double value, double most) {
    report_number(report, name, value);
    if (most > 0.0) {
        printf(", \"judged\": \"%s\"", name);
        report_number(report, "limit", most);
    }
}
