/* The clock, the problem and the solvers of the C part: each run takes all steps of a problem and
 * returns the processor time of the stepping, s. */
#ifndef BENCH_SOLVERS_H
#define BENCH_SOLVERS_H

#include "fmu3_library.h"
#include "fmu_library.h"
#include "loops.h"
#include "rp_manipulator.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

/* ---- bench.c: median; the end of a program that cannot measure */

/* Returns the s between two readings of this clock in a row. */
double clock_cost(void);

/* Of count > 0 values, which it sorts. */
double median(double values[], int count);

/* Ends the program with a line on stderr where the condition does not hold. */
static inline void require(bool condition, const char *what) {
    if (!condition) {
        fprintf(stderr, "bench: %s\n", what);
        exit(1);
    }
}

/* Zeros; ends the program where there is no memory. */
static inline void *allocate(size_t count, size_t size) {
    void *block = calloc(count, size);
    require(block != NULL, "no memory");
    return block;
}

/* ---- problem.c: the arm from one start, with inputs held over each communication step, and its
 * reference solution */

enum problem_inputs {
    INPUTS_ZERO,     /* free motion */
    INPUTS_CONSTANT, /* efforts that do not change */
    INPUTS_CHANGING, /* sines, sampled at the communication points */
};

struct problem {
    double step; /* communication step size, s */
    int steps;
    enum problem_inputs kind;
    double start[4];     /* q1, q2, dq1, dq2 at t = 0 */
    double (*inputs)[2]; /* tau1 in N.m and f2 in N of each step; no sine is in a time measured */
    double (*reference)[4]; /* states at the end of each step */
};

/* Those of the FMU's start values. */
extern const struct rp_parameters problem_parameters;

/* Ends the program if memory runs out. */
struct problem *problem_create(double step, int steps, enum problem_inputs kind);

void problem_destroy(struct problem *problem);

/* dx/dt at the states x with the inputs u */
void problem_rhs(const double x[4], const double u[2], double dx[4]);

/* Largest difference of a state to the reference, over the largest value of that state (at least
 * 1e-3). */
double problem_error(const struct problem *problem, double states[][4]);

/* ---- fmu_run.c: the FMU through its own functions, as an importer calls it */

/* The items of solver_method. */
enum method { CVODE_ADAMS = 1, FIRST_METHOD = CVODE_ADAMS, CVODE_BDF, ERK, TAYLOR, METHODS };
extern const char *const method_names[METHODS];

struct fmu_counts {
    double effective_tolerance;
    double internal_steps; /* per communication step */
    double evaluations;    /* of the right-hand side, per communication step */
};

/* An instance of the FMU with this GUID. */
fmi2Component fmu_instantiate(const struct fmu_functions *fmu, const char *guid);
extern const char fmu_guid_of_arm[];

/* An initialized instance at the problem's start. */
fmi2Component fmu_start(const struct fmu_functions *fmu, const struct problem *problem,
                        enum method method, double tolerance);

/* fmi2SetReal, fmi2DoStep and fmi2GetReal of step i. */
void fmu_step(const struct fmu_functions *fmu, fmi2Component c, const struct problem *problem,
              int i, double x[4]);

double fmu_run(const struct fmu_functions *fmu, const struct problem *problem, enum method method,
               double tolerance, double states[][4], struct fmu_counts *counts);

/* The same through FMI 3.0, with neither event mode nor intermediate updates. */
double fmu3_run(const struct fmu3_functions *fmu, const struct problem *problem, enum method method,
                double tolerance, double states[][4], struct fmu_counts *counts);

/* ---- peer_runs.c */

/* What a user of CVODE would write: CVodeReInit and CVode on N_Vector_Serial. Restarts at every
 * step where inputs change, else continues (CV_NORMAL, with CVODE's interpolation). */
double plain_loop_run(const struct problem *problem, double tolerance, double states[][4]);

enum mujoco_integrator { MUJOCO_RK4, MUJOCO_IMPLICITFAST };

/* False where the benchmark was built without MuJoCo; then nothing else of it may be called. */
bool mujoco_available(void);
const char *mujoco_version(void);

/* MuJoCo on tests/rp_manipulator/rp_manipulator.xml, so many mj_step in a communication step: sets
 * qfrc_applied, steps, reads qpos and qvel. */
double mujoco_run(const struct problem *problem, enum mujoco_integrator integrator, int substeps,
                  double states[][4]);

#endif
