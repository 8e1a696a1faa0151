/* Measures the FMU, through its own functions, against MuJoCo and against the plain loop of
 * CVodeReInit and CVode on N_Vector_Serial that a user of CVODE would write, at the same tolerance
 * as the FMU. All do the same work in turns. Figures are medians of the repeats, as JSON on
 * stdout; compare.py makes tables of them. */
#include "bench.h"

#include <stdlib.h>
#include <string.h>

static const char usage[] =
    "usage: bench RPManipulator.so RPManipulator.so-of-FMI-3.0 RPPlant.so [--repeats N] [--quick] "
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
        if (strcmp(arguments[i], "--quick") == 0) {
            bench.quick = true;
        } else if (strcmp(arguments[i], "--repeats") == 0 && has_value) {
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

    report_open(&bench.report, bench.repeats);
    for (size_t i = 0; i < GROUPS; i++) {
        if (all || chosen[i]) {
            groups[i].measure(&bench);
        }
    }
    report_close(&bench.report);
    return 0;
}
