/* What all solvers of the benchmark integrate: the arm from one start, with inputs held over each
 * communication step, and its reference solution. */
#ifndef BENCH_PROBLEM_H
#define BENCH_PROBLEM_H

#include "rp_manipulator.h"

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
    double g;            /* of the FMU and MuJoCo, m/s^2 */
    double (*reference)[4]; /* states at the end of each step; NULL: not known */
};

/* Those of the FMU's start values. */
extern const struct rp_parameters problem_parameters;

/* With the usual start, moved by shift (rad, m). Ends the program if memory runs out. */
struct problem *problem_create(double step, int steps, enum problem_inputs kind, double shift);

/* From another start, with inputs u that do not change and gravity g; has no reference. */
struct problem *problem_create_without_reference(double step, int steps, const double start[4],
                                                 const double u[2], double g);

void problem_destroy(struct problem *problem);

/* dx/dt at the states x with the inputs u */
void problem_rhs(const double x[4], const double u[2], double dx[4]);

/* Largest difference of a state to the reference, over the largest value of that state (at least
 * 1e-3). */
double problem_error(const struct problem *problem, double states[][4]);

#endif
