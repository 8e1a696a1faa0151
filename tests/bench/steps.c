#include "bench.h"

#include "race.h"

static const struct work {
    const char *name;
    double step; /* s */
    int steps;
    enum problem_inputs inputs;
    double tolerance;
    double adams; /* largest ratios to the plain loop, 0: no target */
    double erk;
} table[] = {
    {"1 ms steps, inputs changing", 1e-3, 2000, INPUTS_CHANGING, 1e-8, 0.5, 0.15},
    {"10 ms steps, inputs changing", 1e-2, 200, INPUTS_CHANGING, 1e-8, 0.5, 0.2},
    {"1 ms steps, inputs constant", 1e-3, 2000, INPUTS_CONSTANT, 1e-8, 0.6, 0.0},
    {"10 ms steps, inputs constant", 1e-2, 200, INPUTS_CONSTANT, 1e-8, 0.0, 0.0},
    {"1 ms steps, inputs changing, tolerance 1e-5", 1e-3, 2000, INPUTS_CHANGING, 1e-5, 0.0, 0.0},
    {"1 ms steps, inputs changing, tolerance 1e-11", 1e-3, 2000, INPUTS_CHANGING, 1e-11, 0.0, 0.0},
    {"one step of 2 s, inputs constant", 2.0, 1, INPUTS_CONSTANT, 1e-8, 0.0, 0.0},
};

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
static void add_fmi3(struct race *race, const struct fmu3_functions *fmu3, double tolerance) {
    static const struct {
        const char *name;
        enum method method;
    } added[] = {{"cvode_adams, FMI 3.0", CVODE_ADAMS}, {"erk, FMI 3.0", ERK}};
    for (size_t i = 0; i < sizeof added / sizeof added[0]; i++) {
        race_add(race, (struct run){.name = added[i].name,
                                    .solver = FMU3,
                                    .method = added[i].method,
                                    .tolerance = tolerance,
                                    .fmu3 = fmu3});
    }
}

static struct target at_most(double limit) {
    return (struct target){limit > 0.0 ? AT_MOST : NO_TARGET, limit};
}

/* A run against another one of the same race. */
static void report_against(const struct race *race, struct report *report, const char *work,
                           const char *name_of_run, const char *peer, struct target target) {
    const int run = race_find(race, name_of_run);
    const double ratio = race_ratio(race, run, race_find(race, peer));
    char name[64];
    snprintf(name, sizeof name, "%s to %s", name_of_run, peer);
    report_row(report, "against", work, name);
    report_number(report, "error", race->error[run]);
    printf("  %-36s %7.3f", name, ratio);
    report_judged(report, "ratio", ratio, target);
    printf("\n");
    report_row_end(report);
}

/* The error of the plain loop bounds that of erk. */
static void report_error(const struct race *race, struct report *report, const char *work) {
    const double ratio = race->error[race_find(race, "erk")] / race->error[0];
    report_row(report, "against", work, "error of erk to that of the plain loop");
    printf("  error of erk to that of the plain loop %.1e", ratio);
    report_judged(report, "ratio", ratio, (struct target){AT_MOST, 1.0});
    printf("\n");
    report_row_end(report);
}

/* Every solver at its own largest tolerance, MuJoCo at its largest step, with that error. */
static void measure_free_motion(struct bench *bench) {
    static const double bound = 1e-8;
    static const char *const work = "one step of 2 s, free motion, error <= 1e-8";
    struct problem *problem = problem_create(2.0, 1, INPUTS_ZERO, 0.0);
    struct race race = {0};
    race_add_usual(&race, &bench->fmu, 1e-8);
    add_mujoco(&race, 0);
    // a method of first order needs millions of steps for this
    race.count -= mujoco_available() ? 1 : 0;
    for (int run = 0; run < race.count; run++) {
        race_tune(&race.runs[run], &bench->fmu, problem, bound);
    }
    race_run(&race, &bench->fmu, problem, bench->repeats);
    race_report(&race, &bench->report, "steps", work, problem, NULL);
    problem_destroy(problem);
}

void measure_steps(struct bench *bench) {
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        const struct work *work = &table[i];
        const bool is_usual = work->tolerance == 1e-8 && work->steps > 1;
        const bool judged = work->tolerance == 1e-8 && work->inputs == INPUTS_CHANGING;
        struct problem *problem = problem_create(work->step, work->steps, work->inputs, 0.0);
        struct race race = {0};
        race_add_usual(&race, &bench->fmu, work->tolerance);
        if (judged) {
            add_mujoco(&race, 1);
        }
        if (is_usual) {
            add_fmi3(&race, &bench->fmu3, work->tolerance);
        }
        race_run(&race, &bench->fmu, problem, bench->repeats);
        const struct target targets[MOST_RUNS] = {
            [CVODE_ADAMS] = at_most(work->adams), [ERK] = at_most(work->erk)};
        race_report(&race, &bench->report, "steps", work->name, problem, targets);
        if (judged) {
            report_error(&race, &bench->report, work->name);
        }
        if (is_usual) {
            report_against(&race, &bench->report, work->name, "cvode_adams, FMI 3.0", "cvode_adams",
                           at_most(1.05));
            report_against(&race, &bench->report, work->name, "erk, FMI 3.0", "erk", at_most(1.05));
        }
        if (judged && mujoco_available()) {
            report_against(&race, &bench->report, work->name, "erk", "MuJoCo RK4",
                           at_most(work->step == 1e-3 ? 0.2 : 0.0));
        }
        problem_destroy(problem);
    }
    measure_free_motion(bench);
}
