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
 * arm.toml refuses, and for states that overflow, may be infinite or NaN. */
#pragma once

#include "arm_values.h"
