/* Measures the FMU, through its own functions, against MuJoCo and against the plain loop of
 * CVodeReInit and CVode on N_Vector_Serial that a user of CVODE would write, at the same tolerance
 * as the FMU. All do the same work in turns. Figures are medians of the repeats, as JSON on
 * stdout; compare.py makes tables of them. */
#include "bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sundials/sundials_config.h>
#include <time.h>

/* ---- Clock and median ------------------------------------------------------------------------ */

double clock_cost(void) {
    double cost[1001];
    for (int i = 0; i < 1001; i++) {
        const double begin = processor_time();
        cost[i] = processor_time() - begin;
    }
    return median(cost, 1001);
}

static int by_value(const void *a, const void *b) {
    const double x = *(const double *)a;
    const double y = *(const double *)b;
    return (x > y) - (x < y);
}

double median(double values[], int count) {
    qsort(values, (size_t)count, sizeof values[0], by_value);
    return values[count / 2];
}

/* ---- Report ---------------------------------------------------------------------------------- */

#ifdef __clang__
#define COMPILER "clang " __clang_version__
#else
#define COMPILER "gcc " __VERSION__
#endif

static bool has_rows;

void report_open(int repeats) {
    printf("{\"machine\": {\"compiler\": \"%s\", \"sundials\": \"%s\", \"MuJoCo\": \"%s\"},\n",
           COMPILER, SUNDIALS_VERSION, mujoco_version());
    printf("\"repeats\": %d, \"rows\": [", repeats);
}

void report_close(void) {
    printf("\n]}\n");
    require(fflush(stdout) == 0, "the figures cannot be written");
}

void report_row(const char *group, const char *work, const char *run) {
    printf("%s\n{\"group\": \"%s\", \"work\": \"%s\", \"run\": \"%s\"", has_rows ? "," : "", group,
           work, run);
    has_rows = true;
}

void report_number(const char *name, double value) {
    require(isfinite(value), "a figure is not finite");
    printf(", \"%s\": %.17g", name, value);
}

void report_row_end(void) {
    putchar('}');
}

void report_judged(const char *name, double value, double most) {
    report_number(name, value);
    if (most > 0.0) {
        printf(", \"judged\": \"%s\"", name);
        report_number("limit", most);
    }
}

/* ---- Program --------------------------------------------------------------------------------- */

static const char usage[] =
    "usage: bench RPManipulator.so RPManipulator.so-of-FMI-3.0 RPPlant.so [--repeats N] "
    "[--only GROUP[,GROUP...]]";

static const struct {
    const char *name;
    void (*measure)(struct bench *bench);
} groups[] = {
    {"steps", measure_steps},
    {"free-motion", measure_free_motion},
    {"life", measure_life},
    {"plant", measure_plant},
};
enum { GROUPS = sizeof groups / sizeof groups[0] };

/* Marks the groups of a list with commas. */
static void choose(char *list, bool chosen[GROUPS]) {
    for (char *name = strtok(list, ","); name != NULL; name = strtok(NULL, ",")) {
        bool is_known = false;
        for (size_t i = 0; i < GROUPS; i++) {
            const bool is_named = strcmp(groups[i].name, name) == 0;
            chosen[i] = chosen[i] || is_named;
            is_known = is_known || is_named;
        }
        require(is_known, "no such group");
    }
}

int main(int count, char **arguments) {
    struct bench bench = {.repeats = 11};
    bool all = true;
    bool chosen[GROUPS] = {false};
    require(count >= 4, usage);
    for (int i = 4; i < count; i++) {
        const bool has_value = i + 1 < count;
        if (strcmp(arguments[i], "--repeats") == 0 && has_value) {
            bench.repeats = (int)strtol(arguments[++i], NULL, 10);
        } else if (strcmp(arguments[i], "--only") == 0 && has_value) {
            choose(arguments[++i], chosen);
            all = false;
        } else {
            require(false, usage);
        }
    }
    require(bench.repeats >= 1 && bench.repeats <= MOST_REPEATS, "from 1 to 101 repeats");
    require(fmu_library_open(arguments[1], &bench.fmu) != NULL, "the FMU cannot be loaded");
    require(fmu3_library_open(arguments[2], &bench.fmu3) != NULL,
            "the FMU of FMI 3.0 cannot be loaded");
    require(fmu_library_open(arguments[3], &bench.plant) != NULL, "RPPlant cannot be loaded");

    report_open(bench.repeats);
    for (size_t i = 0; i < GROUPS; i++) {
        if (all || chosen[i]) {
            groups[i].measure(&bench);
        }
    }
    report_close();
    return 0;
}
