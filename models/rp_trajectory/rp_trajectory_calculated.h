/* The calculated fields of struct rp_trajectory_values that are real. */
#pragma once

#include "rp_trajectory_equations.h"
#include "rp_trajectory_model.h"

/* Writes them from the parameters and the time (s). */
static inline void rp_trajectory_calculate(struct rp_trajectory_values *values, real time) {
    struct trajectory_point point;
    trajectory_evaluate(&values->parameters, time, &point);
    for (int i = 0; i < 2; i++) {
        values->q[i] = point.q[i].position;
        values->dq[i] = point.q[i].velocity;
        values->ddq[i] = point.q[i].acceleration;
        values->ee_position[i] = point.ee[i].position;
        values->ee_velocity[i] = point.ee[i].velocity;
    }
}

/* Derived: first and, unless values_second is NULL, second derivatives of these fields along a
 * curve in the space of parameters and time. */
void rp_trajectory_derivatives(const struct rp_trajectory_values *values, double time,
                               struct rp_trajectory_values *values_first, double time_first,
                               struct rp_trajectory_values *values_second, double time_second);
