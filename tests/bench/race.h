/* Several solvers do the same work in turns, again and again: their times and errors. */
#ifndef BENCH_RACE_H
#define BENCH_RACE_H

#include "fmu3_run.h"
#include "mujoco_run.h"
#include "report.h"

enum { MOST_RUNS = 10, MOST_REPEATS = 101 };

enum solver { PLAIN_LOOP, FMU, FMU3, MUJOCO };

struct run {
    const char *name;
    enum solver solver;
    enum method method; /* of an FMU */
    double tolerance;   /* of the plain loop, or requested from an FMU */
    enum mujoco_integrator integrator;
    int substeps;                      /* of MuJoCo in a communication step */
    const struct fmu_functions *fmu;   /* of FMU, where it is not that of the race */
    const struct fmu3_functions *fmu3; /* of FMU3: the FMU of FMI 3.0 */
};

struct race {
    int count;
    int repeats;
    struct run runs[MOST_RUNS];
    double seconds[MOST_RUNS][MOST_REPEATS]; /* of one communication step */
    double error[MOST_RUNS];
    struct fmu_counts counts[MOST_RUNS]; /* where the solver is an FMU */
};

void race_add(struct race *race, struct run run);

/* The plain loop at the tolerance at which the FMU runs with CVODE, and the FMU with each method.
 */
void race_add_usual(struct race *race, const struct fmu_functions *fmu, double tolerance);

void race_run(struct race *race, const struct fmu_functions *fmu, const struct problem *problem,
              int repeats);

/* Index of the run with this name, -1: none. */
int race_find(const struct race *race, const char *name);

/* Medians over the repeats: time of a communication step, and its ratio to another run's. */
double race_us(const struct race *race, int run);
double race_ratio(const struct race *race, int run, int peer);

/* Prints a line and writes a row for each run; targets of the ratio to the first run, or NULL. */
void race_report(const struct race *race, struct report *report, const char *group,
                 const char *work, const struct problem *problem, const struct target *targets);

/* The largest tolerance, in quarter decades from 1e-3 down, such that no error from there to a
 * ten-thousandth of the bound, or 1e-14, is above the bound. MuJoCo: sets the substeps instead. */
void race_tune(struct run *run, const struct fmu_functions *fmu, const struct problem *problem,
               double bound);

#endif
