/* Equations of the planar Revolute-Prismatic (RP) manipulator.
 *
 * Source of every equation number below: "Example of dynamics computation (Euler-Lagrange and
 * Newton-Euler formulations): Revolute-Prismatic (RP) manipulator (Problem 7.8)", "the notes".
 *
 * Joint 1 turns the L-shaped link 1 about z0 by q[0] (rad); joint 2 slides link 2 by q[1] (m) along
 * the long side of link 1. Frame 0 is fixed: x0 to the right, y0 upward, z0 out of the page.
 * Frames 1 and 2 turn with link 1: x along the short side a, y parallel to z0, z along the slide.
 * SI units throughout; generalized forces tau = (torque on joint 1 in N.m, force on joint 2 in N).
 *
 * The equations are in rp_equations.h and rp_recursion.h: plain C, from which the build derives
 * what else is needed.
 *
 * All functions are pure: they read their inputs, write their trailing outputs, keep nothing,
 * allocate nothing. Inputs are taken as they are; results for parameters that
 * rp_parameters_check refuses, and for states that overflow, may be infinite or NaN. */
#pragma once

#include "arm_values.h"

#include <stdbool.h>
#include <stddef.h>

/* True where the equations have a solution, for parameters in the ranges of struct arm_parameters:
 * m1 lc1^2 + I1z + I2z > 0, without which link 2 at L = 0 leaves joint 1 without inertia. False:
 * why is in text. */
bool rp_parameters_check(const struct arm_parameters *p, char *text, size_t size);

/* Force and moment that each link receives through its joint, in the frame of the link. */
struct rp_joint_loads {
    double f1[3];   /* N */
    double tau1[3]; /* N.m; tau1[1] drives joint 1 */
    double f2[3];   /* N; f2[2] drives joint 2 */
    double tau2[3]; /* N.m */
};
