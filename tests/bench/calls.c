#include "bench.h"

#include <malloc.h>
#include <math.h>
#include <stdlib.h>

/* Times of each call, s, with the clock's own cost taken off. */
struct calls {
    size_t count;
    double *set;
    double *step;
    double *get;
};

static double time_calls(const struct fmu_functions *fmu, const struct problem *problem,
                         enum method method, double states[][4], struct calls *calls) {
    const double clock = clock_cost(now);
    for (size_t done = 0; done < calls->count; done += (size_t)problem->steps) {
        fmi2Component c = fmu_start(fmu, problem, method, 1e-8);
        for (int i = 0; i < problem->steps; i++) {
            const size_t at = done + (size_t)i;
            const double begin = now();
            const fmi2Status set = fmu_set_inputs(fmu, c, problem->inputs[i]);
            const double is_set = now();
            const fmi2Status step = fmu->DoStep(c, problem->step * i, problem->step, 1);
            const double stepped = now();
            const fmi2Status get = fmu_get_states(fmu, c, states[i]);
            const double end = now();
            require(set == fmi2OK && step == fmi2OK && get == fmi2OK, "a step failed");
            calls->set[at] = fmax(0.0, is_set - begin - clock);
            calls->step[at] = fmax(0.0, stepped - is_set - clock);
            calls->get[at] = fmax(0.0, end - stepped - clock);
        }
        fmu->FreeInstance(c);
    }
    return problem_error(problem, states);
}

static void report_calls(struct report *report, const char *name, struct calls *calls,
                         double error) {
    const double step = 1e6 * quantile(calls->step, calls->count, 0.5);
    const double late = 1e6 * quantile(calls->step, calls->count, 0.999);
    report_row(report, "calls", "1 ms steps, inputs changing, each call by itself", name);
    report_number(report, "calls", (double)calls->count);
    report_number(report, "set_us", 1e6 * quantile(calls->set, calls->count, 0.5));
    report_number(report, "step_us", step);
    report_number(report, "get_us", 1e6 * quantile(calls->get, calls->count, 0.5));
    report_number(report, "step_percentile_us", late);
    report_number(report, "step_largest_us", 1e6 * quantile(calls->step, calls->count, 1.0));
    report_number(report, "ratio", late / step);
    report_number(report, "error", error);
    report_row_end(report);
}

void measure_calls(struct bench *bench) {
    struct problem *problem = problem_create(1e-3, 2000, INPUTS_CHANGING, 0.0);
    double(*states)[4] = allocate((size_t)problem->steps, sizeof states[0]);
    struct calls calls = {.count = bench->quick ? 4000 : 1000000};
    calls.set = allocate(calls.count, sizeof(double));
    calls.step = allocate(calls.count, sizeof(double));
    calls.get = allocate(calls.count, sizeof(double));
    for (enum method method = FIRST_METHOD; method < METHODS; method++) {
        const double error = time_calls(&bench->fmu, problem, method, states, &calls);
        report_calls(&bench->report, method_names[method], &calls, error);
    }
    free(calls.get);
    free(calls.step);
    free(calls.set);
    free(states);
    problem_destroy(problem);
}

void measure_life(struct bench *bench) {
    enum { LIVES = 100 };
    struct problem *problem = problem_create(1e-3, 1, INPUTS_CHANGING, 0.0);
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
        report_row(&bench->report, "life", "instantiate to free", method_names[method]);
        report_judged(&bench->report, "us", life, (struct target){AT_MOST, 30.0});
        report_row_end(&bench->report);
        report_row(&bench->report, "life", "memory of an instance after a step",
                   method_names[method]);
        report_judged(&bench->report, "kib", kib, (struct target){AT_MOST, 32.0});
        report_row_end(&bench->report);
    }
    problem_destroy(problem);
}

/* A step with an integrator that returns at once, and one with the Taylor method, in turns. */
static void measure_inputs(struct bench *bench, const char *work, enum problem_inputs inputs) {
    static const struct run taylor = {
        .name = "taylor", .solver = FMU, .method = TAYLOR, .tolerance = 1e-8};
    struct run idle = taylor;
    idle.name = "instance";
    idle.fmu = &bench->idle;
    struct problem *problem = problem_create(1e-3, 2000, inputs, 0.0);
    struct race race = {0};
    race_add(&race, idle);
    race_add(&race, taylor);
    race_run(&race, &bench->fmu, problem, bench->repeats);

    report_row(&bench->report, "instance", work, idle.name);
    report_number(&bench->report, "us", race_us(&race, 0));
    report_number(&bench->report, "ratio", race_ratio(&race, 0, 1));
    report_number(&bench->report, "internal_steps", race.counts[0].internal_steps);
    report_row_end(&bench->report);
    problem_destroy(problem);
}

void measure_instance(struct bench *bench) {
    measure_inputs(bench, "1 ms steps, inputs changing", INPUTS_CHANGING);
    measure_inputs(bench, "1 ms steps, inputs constant", INPUTS_CONSTANT);
}
