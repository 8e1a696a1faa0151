#ifndef LOOPS_H
#define LOOPS_H

#include <cvode/cvode.h>
#include <cvode/cvode_ls.h>
#include <stdbool.h>

/* Returns the s that a processor has worked for this thread: other programs disturb it less than
 * the time of day. */
double processor_time(void);

struct loop {
    CVRhsFn rhs;           /* user data: the inputs */
    CVLsJacFn jacobian;    /* for BDF; NULL: Adams */
    int n;                 /* states */
    double tolerance;      /* relative; absolute ones are a hundredth of it */
    const double *nominal; /* of each state; NULL: 1 */
    double step;           /* s */
    int steps;
    int input_count;
    const double *inputs; /* held over each step */
    bool restarts;        /* CVodeReInit at each step; else CV_NORMAL interpolates */
    double *states;       /* at the end of each step; may be NULL */
};

/* Makes all steps from x, which becomes the last state. Returns the processor time of the stepping,
 * s; NAN if CVODE fails. */
double loop_run(const struct loop *loop, double x[]);

/* Runs a model by its number, with a force (N) where there is one and restarts if there is more
 * than one step. */
double loop_run_model(int index, bool is_stiff, int n, int steps, double tolerance, double step,
                      const double nominal[], const double forces[], double x[]);

#endif
