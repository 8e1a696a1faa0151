/* rp_trajectory_equations.h with derivatives along a curve. */
#ifndef RP_TRAJECTORY_LIFTED_H
#define RP_TRAJECTORY_LIFTED_H

#include "motion_lifted.h"
#include "rp_trajectory.h"

/* A point of a curve in the space of parameters and time, with the first and second derivatives of
 * these along it (in which motion and branch mean nothing). */
struct rp_trajectory_curve {
    const struct rp_trajectory_parameters *value;
    const struct rp_trajectory_parameters *first;
    const struct rp_trajectory_parameters *second;
    struct taylor time; /* s */
};

struct rp_trajectory_point {
    struct motion q[2];  /* rad, m */
    struct motion ee[2]; /* m, frame 0: its position, velocity and acceleration */
};

/* The motion at one point of the curve, whose parameters passed rp_trajectory_check. Where two
 * segments of the motion meet, the formulas of the later one hold. */
void rp_trajectory_evaluate(const struct rp_trajectory_curve *curve,
                            struct rp_trajectory_point *point);

#endif
