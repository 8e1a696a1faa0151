#include "bench.h"

#include <math.h>
#include <string.h>

static const struct work {
    const char *name;
    double step; /* s */
    int steps;
    enum problem_inputs inputs;
    double tolerance;
} table[] = {
    {"1 ms steps, inputs changing", 1e-3, 2000, INPUTS_CHANGING, 1e-8},
    {"10 ms steps, inputs changing", 1e-2, 200, INPUTS_CHANGING, 1e-8},
    {"0.1 s steps, inputs changing", 0.1, 20, INPUTS_CHANGING, 1e-8},
    {"1 ms steps, inputs constant", 1e-3, 2000, INPUTS_CONSTANT, 1e-8},
    {"10 ms steps, inputs constant", 1e-2, 200, INPUTS_CONSTANT, 1e-8},
    {"1 ms steps, inputs changing, tolerance 1e-5", 1e-3, 2000, INPUTS_CHANGING, 1e-5},
    {"1 ms steps, inputs changing, tolerance 1e-11", 1e-3, 2000, INPUTS_CHANGING, 1e-11},
    {"one step of 2 s, inputs constant", 2.0, 1, INPUTS_CONSTANT, 1e-8},
};

/* Times of two runs that are compared. Those with the plain loop are shown in the row of the run.
 */
static const struct ratio {
    const char *work;
    const char *run;
    const char *peer;
    double most; /* the largest that the ratio may be; 0: no target */
} ratios[] = {
    {"1 ms steps, inputs changing", "cvode_adams", "plain loop", 0.5},
    {"1 ms steps, inputs changing", "erk", "plain loop", 0.15},
    {"1 ms steps, inputs changing", "taylor", "plain loop", 0.04},
    {"1 ms steps, inputs changing", "taylor", "erk", 0.42},
    {"1 ms steps, inputs changing", "erk", "MuJoCo RK4", 0.0},
    {"1 ms steps, inputs changing", "taylor", "MuJoCo RK4", 0.13},
    {"10 ms steps, inputs changing", "cvode_adams", "plain loop", 0.5},
    {"10 ms steps, inputs changing", "erk", "plain loop", 0.2},
    {"10 ms steps, inputs changing", "taylor", "erk", 0.42},
    {"10 ms steps, inputs changing", "erk", "MuJoCo RK4", 0.0},
    {"10 ms steps, inputs changing", "taylor", "MuJoCo RK4", 0.0},
    {"0.1 s steps, inputs changing", "taylor", "erk", 0.2},
    {"0.1 s steps, inputs changing", "taylor", "MuJoCo RK4", 0.0},
    {"1 ms steps, inputs constant", "cvode_adams", "plain loop", 0.6},
    {"1 ms steps, inputs constant", "taylor", "cvode_adams", 0.95},
    {"10 ms steps, inputs constant", "taylor", "cvode_adams", 0.45},
    {"one step of 2 s, inputs constant", "taylor", "erk", 0.0},
};
enum { RATIOS = sizeof ratios / sizeof ratios[0] };

/* In steps of 1 ms. */
static const double largest_error_of_taylor = 1e-12;

/* Compared with MuJoCo, and errors with that of the plain loop. */
static bool is_judged(const struct work *work) {
    return work->tolerance == 1e-8 && work->inputs == INPUTS_CHANGING;
}

/* Also through FMI 3.0. */
static bool is_usual(const struct work *work) {
    return work->tolerance == 1e-8 && work->steps > 1;
}

static void add_mujoco(struct race *race, int substeps) {
    static const char *const names[] = {
        [MUJOCO_RK4] = "MuJoCo RK4", [MUJOCO_IMPLICITFAST] = "MuJoCo implicitfast"};
    for (enum mujoco_integrator i = MUJOCO_RK4; mujoco_available() && i <= MUJOCO_IMPLICITFAST;
         i++) {
        race_add(race,
                 (struct run){
                     .name = names[i], .solver = MUJOCO, .integrator = i, .substeps = substeps});
    }
}

/* The same FMU of FMI 3.0. */
static const struct {
    const char *name;
    enum method method;
    double most; /* ratio to the FMU of FMI 2.0 with this method; 0: no target */
} fmi3_runs[] = {{"cvode_adams, FMI 3.0", CVODE_ADAMS, 1.05},
                 {"erk, FMI 3.0", ERK, 1.05},
                 {"taylor, FMI 3.0", TAYLOR, 0.0}};
enum { FMI3_RUNS = sizeof fmi3_runs / sizeof fmi3_runs[0] };

static void add_fmi3(struct race *race, const struct fmu3_functions *fmu3, double tolerance) {
    for (size_t i = 0; i < FMI3_RUNS; i++) {
        race_add(race, (struct run){.name = fmi3_runs[i].name,
                                    .solver = FMU3,
                                    .method = fmi3_runs[i].method,
                                    .tolerance = tolerance,
                                    .fmu3 = fmu3});
    }
}

static struct target at_most(double limit) {
    return (struct target){limit > 0.0 ? AT_MOST : NO_TARGET, limit};
}

/* A run against another one of the same race, if that is there. */
static void report_against(const struct race *race, struct report *report,
                           const struct ratio *against) {
    const int run = race_find(race, against->run);
    const int peer = race_find(race, against->peer);
    if (peer < 0) {
        return;
    }
    const double ratio = race_ratio(race, run, peer);
    char name[64];
    snprintf(name, sizeof name, "%s to %s", against->run, against->peer);
    report_row(report, "against", against->work, name);
    report_number(report, "error", race->error[run]);
    report_judged(report, "ratio", ratio, at_most(against->most));
    report_row_end(report);
}

/* The error of the plain loop bounds that of a method. */
static void report_error(const struct race *race, struct report *report, const char *work,
                         enum method method) {
    const double ratio = race->error[race_find(race, method_names[method])] / race->error[0];
    char name[64];
    snprintf(name, sizeof name, "error of %s to that of the plain loop", method_names[method]);
    report_row(report, "against", work, name);
    report_judged(report, "ratio", ratio, at_most(1.0));
    report_row_end(report);
}

static void report_error_of_taylor(const struct race *race, struct report *report,
                                   const char *work) {
    const double error = race->error[race_find(race, method_names[TAYLOR])];
    report_row(report, "against", work, "error of taylor");
    report_judged(report, "error", error, at_most(largest_error_of_taylor));
    report_row_end(report);
}

/* All comparisons with others than the plain loop. */
static void report_comparisons(const struct race *race, struct report *report,
                               const struct work *work) {
    if (is_judged(work)) {
        if (work->step == 1e-3) {
            report_error_of_taylor(race, report, work->name);
        }
        report_error(race, report, work->name, ERK);
        report_error(race, report, work->name, TAYLOR);
    }
    for (size_t i = 0; is_usual(work) && i < FMI3_RUNS; i++) {
        const struct ratio ratio = {.work = work->name,
                                    .run = fmi3_runs[i].name,
                                    .peer = method_names[fmi3_runs[i].method],
                                    .most = fmi3_runs[i].most};
        report_against(race, report, &ratio);
    }
    for (size_t i = 0; i < RATIOS; i++) {
        if (strcmp(ratios[i].work, work->name) == 0 && race_find(race, ratios[i].peer) != 0) {
            report_against(race, report, &ratios[i]);
        }
    }
}

static void report_work(const struct race *race, struct report *report, const struct work *work,
                        const struct problem *problem) {
    struct target targets[MOST_RUNS] = {{NO_TARGET, 0.0}};
    for (size_t i = 0; i < RATIOS; i++) {
        if (strcmp(ratios[i].work, work->name) == 0 && race_find(race, ratios[i].peer) == 0) {
            targets[race_find(race, ratios[i].run)] = at_most(ratios[i].most);
        }
    }
    race_report(race, report, "steps", work->name, problem, targets);
    report_comparisons(race, report, work);
}

static void measure_work(struct bench *bench, const struct work *work) {
    struct problem *problem = problem_create(work->step, work->steps, work->inputs, 0.0);
    struct race race = {0};
    race_add_usual(&race, &bench->fmu, work->tolerance);
    if (is_judged(work)) {
        add_mujoco(&race, 1);
    }
    if (is_usual(work)) {
        add_fmi3(&race, &bench->fmu3, work->tolerance);
    }
    race_run(&race, &bench->fmu, problem, bench->repeats);
    report_work(&race, &bench->report, work, problem);
    problem_destroy(problem);
}

/* Every solver at its own largest tolerance, MuJoCo at its largest step, with that error. */
static void measure_with_error(struct bench *bench, struct race *race, const char *work,
                               double bound) {
    struct problem *problem = problem_create(2.0, 1, INPUTS_ZERO, 0.0);
    for (int run = 0; run < race->count; run++) {
        race_tune(&race->runs[run], &bench->fmu, problem, bound);
    }
    race_run(race, &bench->fmu, problem, bench->repeats);
    race_report(race, &bench->report, "steps", work, problem, NULL);
    problem_destroy(problem);
}

void measure_steps(struct bench *bench) {
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        measure_work(bench, &table[i]);
    }
}

void measure_free_motion(struct bench *bench) {
    struct race race = {0};
    race_add_usual(&race, &bench->fmu, 1e-8);
    add_mujoco(&race, 0);
    // a method of first order needs millions of steps for this
    race.count -= mujoco_available() ? 1 : 0;
    measure_with_error(bench, &race, "one step of 2 s, free motion, error <= 1e-8", 1e-8);

    // the others here do not come so near
    struct race exact = {0};
    race_add(&exact, (struct run){.name = "taylor", .solver = FMU, .method = TAYLOR});
    measure_with_error(bench, &exact, "one step of 2 s, free motion, error <= 1e-14", 1e-14);
}

/* ---- Sweeps -----------------------------------------------------------------------------------
 */

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
    } swept[] = {
        {"1 ms steps, inputs changing", 1e-3, 2000, INPUTS_CHANGING, 1.0},
        {"10 ms steps, inputs changing", 1e-2, 200, INPUTS_CHANGING, 1.0},
        {"one step of 2 s, free motion", 2.0, 1, INPUTS_ZERO, 0.5},
    };
    for (size_t i = 0; i < sizeof swept / sizeof swept[0]; i++) {
        const int steps = bench->quick && swept[i].steps > 100 ? 100 : swept[i].steps;
        struct problem *problem = problem_create(swept[i].step, steps, swept[i].inputs, 0.0);
        sweep_tolerances(bench, swept[i].name, problem, bench->quick ? 3.5 : swept[i].decades);
        sweep_mujoco(bench, swept[i].name, problem, fmin(swept[i].step, 1e-2));
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
