#define _DEFAULT_SOURCE // getloadavg

#include "report.h"

#include "measure.h"
#include "mujoco_run.h"

#include <stdlib.h>
#include <string.h>
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

static void write_machine(struct json *json) {
    char processor[128];
    double load = 0.0;
    const long cores = sysconf(_SC_NPROCESSORS_ONLN);
    read_processor(processor);
    require(getloadavg(&load, 1) == 1, "no load average");
    printf("%s, %ld cores, load %.1f; %s; SUNDIALS %s%s%s\n", processor, cores, load, COMPILER,
           SUNDIALS_VERSION, mujoco_available() ? "; MuJoCo " : "; built without MuJoCo",
           mujoco_version());
    json_begin(json, "machine", '{');
    json_text(json, "processor", processor);
    json_number(json, "cores", (double)cores);
    json_number(json, "load", load);
    json_text(json, "compiler", COMPILER);
    json_text(json, "sundials", SUNDIALS_VERSION);
    json_text(json, "mujoco", mujoco_version());
    json_end(json, '}');
}

void report_open(struct report *report, const char *path, int repeats) {
    *report = (struct report){.json = {.first = true}};
    if (path != NULL) {
        report->json.file = fopen(path, "w");
        require(report->json.file != NULL, "the JSON file cannot be written");
    }
    json_begin(&report->json, NULL, '{');
    write_machine(&report->json);
    json_number(&report->json, "repeats", repeats);
    json_begin(&report->json, "rows", '[');
}

void report_close(struct report *report) {
    json_end(&report->json, ']');
    json_end(&report->json, '}');
    if (report->json.file != NULL) {
        fputc('\n', report->json.file);
        require(fclose(report->json.file) == 0, "the JSON file cannot be written");
    }
}

void report_row(struct report *report, const char *group, const char *work, const char *run) {
    json_begin(&report->json, NULL, '{');
    json_text(&report->json, "group", group);
    json_text(&report->json, "work", work);
    json_text(&report->json, "run", run);
}

void report_number(struct report *report, const char *name, double value) {
    json_number(&report->json, name, value);
}

void report_row_end(struct report *report) {
    json_end(&report->json, '}');
}

void report_judged(struct report *report, const char *name, double value, struct target target) {
    json_number(&report->json, name, value);
    if (target.comparison == NO_TARGET) {
        return;
    }
    const bool at_most = target.comparison == AT_MOST;
    const bool met = at_most ? value <= target.limit : value >= target.limit;
    report->missed += !met;
    printf("  must be %s %g: %s", at_most ? "<=" : ">=", target.limit, met ? "ok" : "MISSED");
    json_text(&report->json, "judged", name);
    json_text(&report->json, "comparison", at_most ? "<=" : ">=");
    json_number(&report->json, "limit", target.limit);
    json_truth(&report->json, "met", met);
}
