/* A reference motion for tests: all parameters have a value, though only those of one motion count.
 */
#ifndef RP_TRAJECTORY_EXAMPLE_H
#define RP_TRAJECTORY_EXAMPLE_H

#include "rp_trajectory.h"

/* The circle is that of the start values of variables.toml, beside the axis of joint 1. */
static const struct rp_trajectory_parameters rp_trajectory_example = {
    .motion = RP_TRAJECTORY_CIRCLE,
    .branch = RP_TRAJECTORY_FORWARD,
    .l1 = 0.5,
    .a = 0.1,
    .start_time = 0.5,
    .duration = 1.25,
    .q_from = {0.2, -0.1},
    .q_to = {-1.0, 0.3},
    .ee_from = {-0.5, 0.2},
    .ee_to = {-0.3, -0.35},
    .center = {0.4, 0.1},
    .radius = 0.1,
    .start_angle = 0.0,
    .frequency = 0.5,
    .turns = 2.0,
    .ramp_time = 1.0,
    .grasp_time = 0.75,
    .release_time = 1.5,
};

#endif
