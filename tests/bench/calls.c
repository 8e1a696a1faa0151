#include "bench.h"

#include "fmu_run.h"
#include "measure.h"
#include "race.h"

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
    const double set = 1e6 * quantile(calls->set, calls->count, 0.5);
    const double get = 1e6 * quantile(calls->get, calls->count, 0.5);
    const double step = 1e6 * quantile(calls->step, calls->count, 0.5);
    const double late = 1e6 * quantile(calls->step, calls->count, 0.999);
    const double last = 1e6 * quantile(calls->step, calls->count, 1.0);
    const double sum = set + step + get;
    report_row(report, "calls", "1 ms steps, inputs changing, each call by itself", name);
    report_number(report, "calls", (double)calls->count);
    report_number(report, "set_us", set);
    report_number(report, "step_us", step);
    report_number(report, "get_us", get);
    report_number(report, "step_percentile_us", late);
    report_number(report, "step_largest_us", last);
    report_number(report, "ratio", late / step);
    report_number(report, "error", error);
    report_row_end(report);
    printf("  %-12s Set %5.3f us (%2.0f %%), DoStep %6.3f us (%2.0f %%), Get %5.3f us (%2.0f %%); "
           "DoStep 99.9th percentile %6.2f us = %5.2f medians, largest of %zu: %.0f us\n",
           name, set, 100.0 * set / sum, step, 100.0 * step / sum, get, 100.0 * get / sum, late,
           late / step, calls->count, last);
}

void measure_calls(struct bench *bench) {
    struct problem *problem = problem_create(1e-3, 2000, INPUTS_CHANGING, 0.0);
    double(*states)[4] = calloc((size_t)problem->steps, sizeof states[0]);
    struct calls calls = {.count = bench->quick ? 4000 : 1000000};
    calls.set = calloc(calls.count, sizeof(double));
    calls.step = calloc(calls.count, sizeof(double));
    calls.get = calloc(calls.count, sizeof(double));
    require(states != NULL && calls.set != NULL && calls.step != NULL && calls.get != NULL,
            "no memory");
    printf("\neach call by itself, medians; 1 ms steps, inputs changing\n");
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
    printf("\nfrom fmi2Instantiate over initialization to fmi2FreeInstance\n");
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
        printf("  %-12s %6.1f us", method_names[method], life);
        report_judged(&bench->report, "us", life, (struct target){AT_MOST, 30.0});
        report_row_end(&bench->report);
        report_row(&bench->report, "life", "memory of an instance after a step",
                   method_names[method]);
        printf("; memory after a step %5.1f KiB", kib);
        report_judged(&bench->report, "kib", kib, (struct target){AT_MOST, 32.0});
        report_row_end(&bench->report);
        printf("\n");
    }
    problem_destroy(problem);
}
