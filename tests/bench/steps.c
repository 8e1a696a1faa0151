#include "bench.h"

#include <malloc.h>

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

/* Also with MuJoCo. */
static bool is_compared(const struct work *work) {
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
        const struct run run = {names[i], MUJOCO, .integrator = i, .substeps = substeps};
        race_add(race, run);
    }
}

/* The same FMU of FMI 3.0. */
static void add_fmi3(struct race *race, const struct fmu3_functions *fmu3, double tolerance) {
    static const char *const names[METHODS] = {[CVODE_ADAMS] = "cvode_adams, FMI 3.0",
                                               [ERK] = "erk, FMI 3.0",
                                               [TAYLOR] = "taylor, FMI 3.0"};
    for (enum method method = FIRST_METHOD; method < METHODS; method++) {
        if (names[method] != NULL) {
            race_add(race, (struct run){names[method], FMU3, method, .tolerance = tolerance,
                                        .fmu3 = fmu3});
        }
    }
}

static void measure_work(struct bench *bench, const struct work *work) {
    struct problem *problem = problem_create(work->step, work->steps, work->inputs);
    struct race race = {0};
    race_add_usual(&race, &bench->fmu, work->tolerance);
    if (is_compared(work)) {
        add_mujoco(&race, 1);
    }
    if (is_usual(work)) {
        add_fmi3(&race, &bench->fmu3, work->tolerance);
    }
    race_run(&race, &bench->fmu, problem, bench->repeats);
    race_report(&race, "steps", work->name, problem);
    problem_destroy(problem);
}

/* Every solver at its own largest tolerance, MuJoCo at its largest step, with that error. */
static void measure_with_error(struct bench *bench, struct race *race, const char *work,
                               double bound) {
    struct problem *problem = problem_create(2.0, 1, INPUTS_ZERO);
    for (int run = 0; run < race->count; run++) {
        race_tune(&race->runs[run], &bench->fmu, problem, bound);
    }
    race_run(race, &bench->fmu, problem, bench->repeats);
    race_report(race, "steps", work, problem);
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
    race_add_method(&exact, TAYLOR, 0.0);
    measure_with_error(bench, &exact, "one step of 2 s, free motion, error <= 1e-14", 1e-14);
}

void measure_life(struct bench *bench) {
    enum { LIVES = 100 };
    struct problem *problem = problem_create(1e-3, 1, INPUTS_CHANGING);
    double us[METHODS][MOST_REPEATS];
    for (int repeat = 0; repeat < bench->repeats; repeat++) {
        for (enum method method = FIRST_METHOD; method < METHODS; method++) {
            const double begin = processor_time();
            for (int life = 0; life < LIVES; life++) {
                bench->fmu.FreeInstance(fmu_start(&bench->fmu, problem, method, 1e-8));
            }
            us[method][repeat] = 1e6 * (processor_time() - begin) / LIVES;
        }
    }
    for (enum method method = FIRST_METHOD; method < METHODS; method++) {
        double state[4];
        const size_t before = mallinfo2().uordblks;
        fmi2Component c = fmu_start(&bench->fmu, problem, method, 1e-8);
        fmu_step(&bench->fmu, c, problem, 0, state);
        const double kib = (double)(mallinfo2().uordblks - before) / 1024.0;
        bench->fmu.FreeInstance(c);
        const double life = median(us[method], bench->repeats);
        report_row("life", "instantiate to free", method_names[method]);
        report_judged("us", life, 30.0);
        report_row_end();
        report_row("life", "memory of an instance after a step", method_names[method]);
        report_judged("kib", kib, 32.0);
        report_row_end();
    }
    problem_destroy(problem);
}
