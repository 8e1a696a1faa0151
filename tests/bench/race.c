#include "bench.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

void race_add(struct race *race, struct run run) {
    require(race->count < MOST_RUNS, "too many runs");
    race->runs[race->count++] = run;
}

static double run_once(const struct run *run, const struct fmu_functions *fmu,
                       const struct problem *problem, double states[][4],
                       struct fmu_counts *counts) {
    switch (run->solver) {
    case PLAIN_LOOP:
        return plain_loop_run(problem, run->tolerance, states);
    case FMU:
        return fmu_run(fmu, problem, run->method, run->tolerance, states, counts);
    case FMU3:
        return fmu3_run(run->fmu3, problem, run->method, run->tolerance, states, counts);
    case MUJOCO:
        return mujoco_run(problem, run->integrator, run->substeps, states);
    }
    return 0.0;
}

void race_add_method(struct race *race, enum method method, double tolerance) {
    race_add(race, (struct run){method_names[method], FMU, method, .tolerance = tolerance});
}

void race_add_usual(struct race *race, const struct fmu_functions *fmu, double tolerance) {
    struct problem *problem = problem_create(1e-3, 1, INPUTS_ZERO);
    struct fmu_counts counts;
    double states[1][4];
    fmu_run(fmu, problem, CVODE_ADAMS, tolerance, states, &counts);
    problem_destroy(problem);
    race_add(race, (struct run){"plain loop", PLAIN_LOOP, .tolerance = counts.effective_tolerance});
    for (enum method method = FIRST_METHOD; method < METHODS; method++) {
        race_add_method(race, method, tolerance);
    }
}

/* s for a communication step, mean of so many runs that the reading of the clock does not count. */
static double run_long_enough(struct race *race, int run, const struct fmu_functions *fmu,
                              const struct problem *problem, double states[][4]) {
    const double clock = clock_cost();
    double seconds = 0.0;
    int passes = 0;
    while (passes == 0 || (seconds < 2e-3 && passes < 200)) {
        seconds += run_once(&race->runs[run], fmu, problem, states, &race->counts[run]) - clock;
        passes++;
    }
    return seconds / passes / problem->steps;
}

void race_run(struct race *race, const struct fmu_functions *fmu, const struct problem *problem,
              int repeats) {
    double(*states)[4] = allocate((size_t)problem->steps, sizeof states[0]);
    race->repeats = repeats;
    for (int repeat = 0; repeat < repeats; repeat++) {
        for (int run = 0; run < race->count; run++) {
            race->seconds[run][repeat] = run_long_enough(race, run, fmu, problem, states);
            race->error[run] = problem_error(problem, states);
        }
    }
    free(states);
}

double race_us(const struct race *race, int run) {
    double seconds[MOST_REPEATS];
    memcpy(seconds, race->seconds[run], sizeof seconds);
    return 1e6 * median(seconds, race->repeats);
}

void race_report(const struct race *race, const char *group, const char *work,
                 const struct problem *problem) {
    static const char *const ends[4] = {"end_q1", "end_q2", "end_dq1", "end_dq2"};
    for (int i = 0; i < race->count; i++) {
        const struct run *run = &race->runs[i];
        report_row(group, work, run->name);
        report_number("step", problem->step);
        report_number("steps", problem->steps);
        report_number("us", race_us(race, i));
        report_number("error", race->error[i]);
        for (int j = 0; j < 4; j++) { // of the reference, for other references to compare with
            report_number(ends[j], problem->reference[problem->steps - 1][j]);
        }
        if (run->solver == MUJOCO) {
            report_number("substeps", run->substeps);
        } else {
            report_number("tolerance", run->tolerance);
        }
        if (run->solver == FMU || run->solver == FMU3) {
            report_number("effective_tolerance", race->counts[i].effective_tolerance);
            report_number("internal_steps", race->counts[i].internal_steps);
            report_number("evaluations", race->counts[i].evaluations);
        }
        report_row_end();
    }
}

void race_tune(struct run *run, const struct fmu_functions *fmu, const struct problem *problem,
               double bound) {
    double(*states)[4] = allocate((size_t)problem->steps, sizeof states[0]);
    struct fmu_counts counts;
    if (run->solver == MUJOCO) {
        run->substeps = 10;
        run_once(run, fmu, problem, states, &counts);
        while (problem_error(problem, states) > bound) {
            run->substeps += run->substeps / 4 + 1;
            require(run->substeps < 1000000, "no time step of MuJoCo meets the required error");
            run_once(run, fmu, problem, states, &counts);
        }
    } else {
        double best = 0.0;
        const int first = (int)lround(4.0 * log10(fmax(1e-4 * bound, 1e-14)));
        for (int quarter = first; quarter <= -12; quarter++) {
            run->tolerance = pow(10.0, quarter / 4.0);
            run_once(run, fmu, problem, states, &counts);
            if (problem_error(problem, states) > bound) {
                break;
            }
            best = run->tolerance;
        }
        require(best > 0.0, "no tolerance meets the required error");
        run->tolerance = best;
    }
    free(states);
}
