/* Several solvers do the same work in turns, again and again. */
#ifndef BENCH_TURNS_H
#define BENCH_TURNS_H

#include "fmu_run.h"
#include "mujoco_run.h"
#include "report.h"

enum { MOST_RUNS = 8, MOST_REPEATS = 101 };

enum solver { PLAIN_LOOP, FMU, MUJOCO };

struct run {
    const char *name;
    enum solver solver;
    enum method method; /* of the FMU */
    double tolerance;   /* of the plain loop, or requested from the FMU */
    enum mujoco_integrator integrator;
    int substeps; /* of MuJoCo in a communication step */
};

struct turns {
    int count;
    int repeats;
    struct run runs[MOST_RUNS];
    double seconds[MOST_RUNS][MOST_REPEATS]; /* of one communication step */
    double error[MOST_RUNS];
    struct fmu_counts counts[MOST_RUNS]; /* where the solver is the FMU */
};

void turns_add(struct turns *turns, struct run run);

/* The plain loop at the tolerance at which the FMU runs with CVODE, and the FMU with each method.
 */
void turns_add_usual(struct turns *turns, const struct fmu_functions *fmu, double tolerance);

void turns_take(struct turns *turns, const struct fmu_functions *fmu, const struct problem *problem,
                int repeats);

/* Index of the run with this name, -1: none. */
int turns_find(const struct turns *turns, const char *name);

/* Medians over the repeats: time of a communication step, and its ratio to another run's. */
double turns_us(const struct turns *turns, int run);
double turns_ratio(const struct turns *turns, int run, int peer);

/* Prints a line and writes a row for each run; targets of the ratio to the first run, or NULL. */
void turns_report(const struct turns *turns, struct report *report, const char *group,
                  const char *work, const struct problem *problem, const struct target *targets);

/* The largest tolerance on a grid of quarter decades from 1e-3 on from which on down to 1e-12 no
 * error is above the bound. MuJoCo: sets the substeps instead. */
void turns_tune(struct run *run, const struct fmu_functions *fmu, const struct problem *problem,
                double bound);

#endif
