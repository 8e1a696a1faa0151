/* Reference motions of the RP manipulator, twice continuously differentiable in time: from one
 * position of the joints to another, along a straight line, along a circle. Symbols and formulas as
 * in README.md. */
#pragma once

#include "rp_reachability.h"
#include "rp_trajectory_equations.h"

/* Writes the fields that have no value in rp_trajectory.toml. */
static inline void rp_trajectory_calculate(struct rp_trajectory_values *values) {
    struct trajectory_point point;
    trajectory_evaluate(&values->parameters, values->time, &point);
    values->q1_ref = point.q[0].position;
    values->q2_ref = point.q[1].position;
    values->dq1_ref = point.q[0].velocity;
    values->dq2_ref = point.q[1].velocity;
    values->ddq1_ref = point.q[0].acceleration;
    values->ddq2_ref = point.q[1].acceleration;
    values->ee_x_ref = point.ee[0].position;
    values->ee_y_ref = point.ee[1].position;
    values->ee_vx_ref = point.ee[0].velocity;
    values->ee_vy_ref = point.ee[1].velocity;

    const struct near_point nearest = nearest_of_path(&values->parameters);
    values->nearest_x = nearest.x;
    values->nearest_y = nearest.y;
    values->distance = nearest.distance;
}
