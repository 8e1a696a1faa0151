/* Derivatives of the reference motions by the time, which the model's outputs do not all show. */
#ifndef TRAJECTORY_DERIVATIVES_H
#define TRAJECTORY_DERIVATIVES_H

#include "rp_trajectory_equations.h"

/* Derived: first and second derivatives along a curve of the time. */
void trajectory_derivatives(const struct rp_trajectory_parameters *p, double time, double first,
                            struct trajectory_point *point_first, double second,
                            struct trajectory_point *point_second);

#endif
