/* The measurements, the report and races. bench.c chooses and reports. */
#ifndef BENCH_H
#define BENCH_H

#include "solvers.h"

/* ---- bench.c: a JSON object on stdout */

/* The object begins with compiler and libraries, and the repeats. */
void report_open(int repeats);
void report_close(void);

/* A row: which measurement, of what work, done by whom. Its numbers follow; they must be finite. */
void report_row(const char *group, const char *work, const char *run);
void report_number(const char *name, double value);
void report_row_end(void);

/* Writes a number and its target: the largest value it may have, or 0 if it has none. */
void report_judged(const char *name, double value, double most);

/* ---- race.c: several solvers do the same work in turns, again and again */

enum { MOST_RUNS = 10, MOST_REPEATS = 101 };

enum solver { PLAIN_LOOP, FMU, FMU3, MUJOCO };

struct run {
    const char *name;
    enum solver solver;
    enum method method; /* of an FMU */
    double tolerance;   /* of the plain loop, or requested from an FMU */
    enum mujoco_integrator integrator;
    int substeps;                      /* of MuJoCo in a communication step */
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
void race_add_method(struct race *race, enum method method, double tolerance);

/* The plain loop at the tolerance at which the FMU runs with CVODE, and the FMU with each method.
 */
void race_add_usual(struct race *race, const struct fmu_functions *fmu, double tolerance);

void race_run(struct race *race, const struct fmu_functions *fmu, const struct problem *problem,
              int repeats);

/* Median over the repeats: us of a communication step. */
double race_us(const struct race *race, int run);

/* Writes a row for each run. */
void race_report(const struct race *race, const char *group, const char *work,
                 const struct problem *problem);

/* The largest tolerance, in quarter decades from 1e-3 down, such that no error from there to a
 * ten-thousandth of the bound, or 1e-14, is above the bound. MuJoCo: sets the substeps instead. */
void race_tune(struct run *run, const struct fmu_functions *fmu, const struct problem *problem,
               double bound);

/* ---- The measurements */

struct bench {
    struct fmu_functions fmu;
    struct fmu3_functions fmu3;
    struct fmu_functions plant; /* RPPlant */
    int repeats;
};

/* steps.c: communication steps against the plain loop and MuJoCo; free motion at equal errors */
void measure_steps(struct bench *bench);
void measure_free_motion(struct bench *bench);

/* plant.c: friction and stops, against the arm without them */
void measure_plant(struct bench *bench);

/* steps.c: from fmi2Instantiate to fmi2FreeInstance, and memory */
void measure_life(struct bench *bench);

#endif
