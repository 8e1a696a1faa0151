#include "turns.h"

#include "measure.h"
#include "plain_loop.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void turns_add(struct turns *turns, struct run run) {
    require(turns->count < MOST_RUNS, "too many runs");
    turns->runs[turns->count++] = run;
}

static double run_once(const struct run *run, const struct fmu_functions *fmu,
                       const struct problem *problem, double states[][4],
                       struct fmu_counts *counts) {
    switch (run->solver) {
    case PLAIN_LOOP:
        return plain_loop_run(problem, run->tolerance, states);
    case FMU:
        return fmu_run(fmu, problem, run->method, run->tolerance, states, counts);
    case MUJOCO:
        return mujoco_run(problem, run->integrator, run->substeps, states);
    }
    return 0.0;
}

void turns_add_usual(struct turns *turns, const struct fmu_functions *fmu, double tolerance) {
    struct problem *problem = problem_create(1e-3, 1, INPUTS_ZERO, 0.0);
    struct fmu_counts counts;
    double states[1][4];
    fmu_run(fmu, problem, CVODE_ADAMS, tolerance, states, &counts);
    problem_destroy(problem);
    turns_add(turns, (struct run){.name = "plain loop",
                                  .solver = PLAIN_LOOP,
                                  .tolerance = counts.effective_tolerance});
    static const char *const names[] = {
        [CVODE_ADAMS] = "cvode_adams", [CVODE_BDF] = "cvode_bdf", [ERK] = "erk"};
    for (enum method method = CVODE_ADAMS; method <= ERK; method++) {
        turns_add(turns, (struct run){.name = names[method],
                                      .solver = FMU,
                                      .method = method,
                                      .tolerance = tolerance});
    }
}

/* s for a communication step, mean of so many runs that the reading of the clock does not count. */
static double run_long_enough(struct turns *turns, int run, const struct fmu_functions *fmu,
                              const struct problem *problem, double states[][4]) {
    const double clock = clock_cost(processor_time);
    double seconds = 0.0;
    int passes = 0;
    while (passes == 0 || (seconds < 2e-3 && passes < 200)) {
        seconds += run_once(&turns->runs[run], fmu, problem, states, &turns->counts[run]) - clock;
        passes++;
    }
    return seconds / passes / problem->steps;
}

void turns_take(struct turns *turns, const struct fmu_functions *fmu, const struct problem *problem,
                int repeats) {
    double(*states)[4] = calloc((size_t)problem->steps, sizeof states[0]);
    require(states != NULL && repeats <= MOST_REPEATS, "no memory");
    turns->repeats = repeats;
    for (int repeat = 0; repeat < repeats; repeat++) {
        for (int run = 0; run < turns->count; run++) {
            turns->seconds[run][repeat] = run_long_enough(turns, run, fmu, problem, states);
            turns->error[run] = problem_error(problem, states);
        }
    }
    free(states);
}

int turns_find(const struct turns *turns, const char *name) {
    for (int run = 0; run < turns->count; run++) {
        if (strcmp(turns->runs[run].name, name) == 0) {
            return run;
        }
    }
    return -1;
}

double turns_us(const struct turns *turns, int run) {
    double seconds[MOST_REPEATS];
    memcpy(seconds, turns->seconds[run], sizeof seconds);
    return 1e6 * median(seconds, turns->repeats);
}

double turns_ratio(const struct turns *turns, int run, int peer) {
    double ratios[MOST_REPEATS];
    for (int repeat = 0; repeat < turns->repeats; repeat++) {
        ratios[repeat] = turns->seconds[run][repeat] / turns->seconds[peer][repeat];
    }
    return median(ratios, turns->repeats);
}

void turns_report(const struct turns *turns, struct report *report, const char *group,
                  const char *work, const struct problem *problem, const struct target *targets) {
    static const char *const ends[4] = {"end_q1", "end_q2", "end_dq1", "end_dq2"};
    printf("\n%s\n", work);
    for (int i = 0; i < turns->count; i++) {
        const struct run *run = &turns->runs[i];
        const double us = turns_us(turns, i);
        report_row(report, group, work, run->name);
        report_number(report, "step", problem->step);
        report_number(report, "steps", problem->steps);
        report_number(report, "us", us);
        report_number(report, "error", turns->error[i]);
        for (int j = 0; j < 4; j++) { // of the reference, for other references to compare with
            report_number(report, ends[j], problem->reference[problem->steps - 1][j]);
        }
        printf("  %-19s %9.2f us", run->name, us);
        const double ratio = turns_ratio(turns, i, 0);
        printf(" %7.3f  error %7.1e", ratio, turns->error[i]);
        if (run->solver == MUJOCO) {
            report_number(report, "substeps", run->substeps);
            printf("  timestep %g ms", 1e3 * problem->step / run->substeps);
        } else {
            report_number(report, "tolerance", run->tolerance);
            printf("  tolerance %7.1e", run->tolerance);
        }
        if (run->solver == FMU) {
            report_number(report, "effective_tolerance", turns->counts[i].effective_tolerance);
            report_number(report, "internal_steps", turns->counts[i].internal_steps);
            report_number(report, "evaluations", turns->counts[i].evaluations);
            printf(", runs at %7.1e, %6.1f steps, %6.1f evaluations",
                   turns->counts[i].effective_tolerance, turns->counts[i].internal_steps,
                   turns->counts[i].evaluations);
        }
        report_judged(report, "ratio", ratio,
                      targets == NULL ? (struct target){NO_TARGET, 0.0} : targets[i]);
        printf("\n");
        report_row_end(report);
    }
}

void turns_tune(struct run *run, const struct fmu_functions *fmu, const struct problem *problem,
                double bound) {
    double(*states)[4] = calloc((size_t)problem->steps, sizeof states[0]);
    struct fmu_counts counts;
    require(states != NULL, "no memory");
    if (run->solver == MUJOCO) {
        run->substeps = 10;
        run_once(run, fmu, problem, states, &counts);
        while (problem_error(problem, states) > bound) {
            run->substeps += run->substeps / 4 + 1;
            require(run->substeps < 1000000, "no time step of MuJoCo meets the error asked for");
            run_once(run, fmu, problem, states, &counts);
        }
    } else {
        double best = 0.0;
        for (int quarter = -48; quarter <= -12; quarter++) {
            run->tolerance = pow(10.0, quarter / 4.0);
            run_once(run, fmu, problem, states, &counts);
            if (problem_error(problem, states) > bound) {
                break;
            }
            best = run->tolerance;
        }
        require(best > 0.0, "no tolerance meets the error asked for");
        run->tolerance = best;
    }
    free(states);
}
