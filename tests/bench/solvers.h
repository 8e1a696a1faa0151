/* The clock, the problem and the solvers of the C part: each run takes all steps of a problem and
 * returns the processor time of the stepping, s. */
#ifndef BENCH_SOLVERS_H
#define BENCH_SOLVERS_H

#include "fmu3_library.h"
#include "fmu_library.h"
#include "rp_manipulator.h"

#include <cvode/cvode.h>
#include <cvode/cvode_ls.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

/* ---- loops.c */

/* Returns the s that a processor has worked for this thread: other programs disturb it less than
 * the time of day. */
double processor_time(void);

/* A loop of CVODE on N_Vector_Serial, as a user would write it. */
struct loop {
    CVRhsFn rhs;           /* user data: the inputs */
    CVLsJacFn jacobian;    /* for BDF; NULL: Adams */
    int n;                 /* states */
    double tolerance;      /* relative; absolute ones are a hundredth of it, times nominal values */
    const double *nominal; /* NULL: 1 */
    double step;           /* s */
    int steps;
    int input_count;
    const double *inputs; /* of each step */
    bool restarts;        /* CVodeReInit at every step; else CV_NORMAL interpolates */
    double *states;       /* at the end of each step; may be NULL */
};

/* Makes all steps from x, which becomes the last state. Returns the processor time of them, s. */
double loop_run(const struct loop *loop, double x[]);

/* Runs a model of loops.c by its number; with restarts if there is more than one step. forces: of
 * each step, N. */
double loop_run_model(int index, bool is_stiff, int n, int steps, double tolerance, double step,
                      const double nominal[], const double forces[], double x[]);

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

/* Restarts where inputs change. */
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
