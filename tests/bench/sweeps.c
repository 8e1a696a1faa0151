#include "bench.h"

#include "race.h"

#include <math.h>

/* Down to 1e-11, and with the Taylor method to 1e-14. */
static void sweep_tolerances(struct bench *bench, const char *name, const struct problem *problem,
                             double decades) {
    const int count = (int)lround(10.0 / decades);
    for (int i = 0; i <= count; i++) {
        const double tolerance = pow(10.0, -4.0 - i * decades);
        struct race race = {0};
        if (tolerance > 0.9e-11) {
            race_add_usual(&race, &bench->fmu, tolerance);
        } else {
            race_add(&race, (struct run){.name = method_names[TAYLOR],
                                         .solver = FMU,
                                         .method = TAYLOR,
                                         .tolerance = tolerance});
        }
        race_run(&race, &bench->fmu, problem, bench->repeats);
        race_report(&race, &bench->report, "precision", name, problem, NULL);
    }
}

static void sweep_mujoco(struct bench *bench, const char *name, const struct problem *problem,
                         double longest) {
    const double ratio = bench->quick ? 10.0 : 2.0;
    const int count = (int)floor(log(longest / 2e-5) / log(ratio));
    for (int i = 0; i <= count; i++) {
        const double substep = longest / pow(ratio, i);
        const int substeps = (int)lround(problem->step / substep);
        if (!mujoco_available() || substeps < 1) {
            continue;
        }
        struct race race = {0};
        race_add(&race, (struct run){.name = "MuJoCo RK4",
                                     .solver = MUJOCO,
                                     .integrator = MUJOCO_RK4,
                                     .substeps = substeps});
        race_add(&race, (struct run){.name = "MuJoCo implicitfast",
                                     .solver = MUJOCO,
                                     .integrator = MUJOCO_IMPLICITFAST,
                                     .substeps = substeps});
        race_run(&race, &bench->fmu, problem, bench->repeats);
        race_report(&race, &bench->report, "precision", name, problem, NULL);
    }
}

void measure_precision(struct bench *bench) {
    static const struct {
        const char *name;
        double step;
        int steps;
        enum problem_inputs inputs;
        double decades; /* from one tolerance to the next */
    } table[] = {
        {"1 ms steps, inputs changing", 1e-3, 2000, INPUTS_CHANGING, 1.0},
        {"10 ms steps, inputs changing", 1e-2, 200, INPUTS_CHANGING, 1.0},
        {"one step of 2 s, free motion", 2.0, 1, INPUTS_ZERO, 0.5},
    };
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        const int steps = bench->quick && table[i].steps > 100 ? 100 : table[i].steps;
        struct problem *problem = problem_create(table[i].step, steps, table[i].inputs, 0.0);
        sweep_tolerances(bench, table[i].name, problem, bench->quick ? 3.5 : table[i].decades);
        sweep_mujoco(bench, table[i].name, problem, fmin(table[i].step, 1e-2));
        problem_destroy(problem);
    }
}

void measure_step_sizes(struct bench *bench) {
    static const double sizes[] = {1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2,
                                   2e-2, 5e-2, 0.1,  0.2,  0.5,  1.0};
    static const struct {
        enum problem_inputs inputs;
        const char *name;
    } kinds[] = {{INPUTS_CHANGING, "inputs changing"}, {INPUTS_CONSTANT, "inputs constant"}};
    const double duration = 2.0;
    for (size_t kind = 0; kind < 2; kind++) {
        for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i += bench->quick ? 6 : 1) {
            const int steps = (int)fmin(round(duration / sizes[i]), bench->quick ? 100 : 1000);
            char work[64];
            snprintf(work, sizeof work, "steps of %g ms, %s", 1e3 * sizes[i], kinds[kind].name);
            struct problem *problem = problem_create(sizes[i], steps, kinds[kind].inputs, 0.0);
            struct race race = {0};
            race_add_usual(&race, &bench->fmu, 1e-8);
            race_run(&race, &bench->fmu, problem, bench->repeats);
            race_report(&race, &bench->report, "step size", work, problem, NULL);
            problem_destroy(problem);
        }
    }
}
