/* What compare.py and by_models.py call of libbench.so: each solver takes all steps of a work. */
#ifndef BENCH_H
#define BENCH_H

#include <cvode/cvode.h>
#include <cvode/cvode_ls.h>
#include <stdbool.h>
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

/* ---- solvers.c; solvers.py has the same structures */

enum solver { PLAIN_LOOP, FMU2, FMU3, MUJOCO_RK4, MUJOCO_IMPLICITFAST };

/* Value references, and what is set before the first step. */
struct fmu {
    void *functions; /* bench_open */
    const char *token;
    int real_count;
    const unsigned *reals;
    const double *real_values;
    int choice_count; /* enumerations */
    const unsigned *choices;
    const int *choice_values;
    unsigned inputs[2];
    unsigned states[4];
    unsigned effective_tolerance;
    unsigned totals[3]; /* internal steps, evaluations of the right-hand side, events */
    int total_count;    /* 2 without events */
};

/* The arm from one start, with inputs held over each communication step. */
struct task {
    int solver;       /* enum solver */
    double tolerance; /* of the plain loop, or requested from an FMU */
    int substeps;     /* of MuJoCo in a communication step */
    const struct fmu *fmu;
    double step; /* s */
    int steps;
    bool changes;              /* inputs differ from step to step */
    double start[4];           /* q1, q2, dq1, dq2 */
    const double (*inputs)[2]; /* tau1 in N.m and f2 in N of each step */
    double (*states)[4];       /* at the end of each step; filled */
    double effective_tolerance;
    double totals[3];
};

/* Returns the functions of a shared object, of FMI 2.0 or 3.0. */
void *bench_open(const char *path, int version);

/* Runs a task so many times. Returns the processor time of a communication step, a mean, s. */
double bench_run(struct task *task, int passes);

/* Returns the processor time from fmi2Instantiate to fmi2FreeInstance, a mean, s; kib: memory of an
 * instance after a step. */
double bench_life(struct task *task, int lives, double *kib);

/* "" where it was built without MuJoCo; then no task may ask for it. */
const char *bench_mujoco_version(void);

/* Compiler, and SUNDIALS of the loops. */
const char *bench_made_by(void);

/* Ends the program with a line on stderr where the condition does not hold. */
static inline void require(bool condition, const char *what) {
    if (!condition) {
        fprintf(stderr, "bench: %s\n", what);
        exit(1);
    }
}

#endif
