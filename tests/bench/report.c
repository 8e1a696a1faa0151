#define _DEFAULT_SOURCE // getloadavg

#include "bench.h"

#include <math.h>
#include <sundials/sundials_config.h>
#include <unistd.h>

#ifdef __clang__
#define COMPILER "clang " __clang_version__
#else
#define COMPILER "gcc " __VERSION__
#endif

static void read_processor(char name[static 128]) {
    char line[256];
    FILE *file = fopen("/proc/cpuinfo", "r");
    snprintf(name, 128, "unknown");
    while (file != NULL && fgets(line, sizeof line, file) != NULL) {
        if (sscanf(line, "model name : %127[^\n]", name) == 1) {
            break;
        }
    }
    if (file != NULL) {
        fclose(file);
    }
}

/* Comma, line break and name; NULL inside an array. */
static void begin_value(struct report *report, const char *name) {
    printf(report->is_first ? "\n" : ",\n");
    report->is_first = false;
    if (name != NULL) {
        printf("\"%s\": ", name);
    }
}

static void open_bracket(struct report *report, const char *name, char bracket) {
    begin_value(report, name);
    putchar(bracket);
    report->is_first = true;
}

static void close_bracket(struct report *report, char bracket) {
    printf("\n%c", bracket);
    report->is_first = false;
}

static void text(struct report *report, const char *name, const char *value) {
    begin_value(report, name);
    putchar('"');
    for (const char *c = value; *c != '\0'; c++) {
        printf(*c == '"' || *c == '\\' ? "\\%c" : "%c", (unsigned char)*c < ' ' ? ' ' : *c);
    }
    putchar('"');
}

void report_open(struct report *report, int repeats) {
    char processor[128];
    double load = 0.0;
    read_processor(processor);
    require(getloadavg(&load, 1) == 1, "no load average");
    report->is_first = true;
    open_bracket(report, NULL, '{');
    open_bracket(report, "machine", '{');
    text(report, "processor", processor);
    report_number(report, "cores", (double)sysconf(_SC_NPROCESSORS_ONLN));
    report_number(report, "load", load);
    text(report, "compiler", COMPILER);
    text(report, "sundials", SUNDIALS_VERSION);
    text(report, "mujoco", mujoco_version());
    close_bracket(report, '}');
    report_number(report, "repeats", repeats);
    open_bracket(report, "rows", '[');
}

void report_close(struct report *report) {
    close_bracket(report, ']');
    close_bracket(report, '}');
    putchar('\n');
    require(fflush(stdout) == 0, "the figures cannot be written");
}

void report_row(struct report *report, const char *group, const char *work, const char *run) {
    open_bracket(report, NULL, '{');
    text(report, "group", group);
    text(report, "work", work);
    text(report, "run", run);
}

void report_number(struct report *report, const char *name, double value) {
    require(isfinite(value), "a figure is not finite");
    begin_value(report, name);
    printf("%.17g", value);
}

void report_row_end(struct report *report) {
    close_bracket(report, '}');
}

void report_judged(struct report *report, const char *name, double value, struct target target) {
    report_number(report, name, value);
    if (target.comparison == NO_TARGET) {
        return;
    }
    const bool at_most = target.comparison == AT_MOST;
    text(report, "judged", name);
    text(report, "comparison", at_most ? "<=" : ">=");
    report_number(report, "limit", target.limit);
    begin_value(report, "met");
    printf((at_most ? value <= target.limit : value >= target.limit) ? "true" : "false");
}
