/* The manipulator as the instance runs it: its value structure, to which variables.toml binds the
 * variables, and its struct model. */
#pragma once

#include "model.h"
#include "rp_manipulator.h"

struct rp_values {
    struct rp_parameters parameters;
    double tau[2]; /* inputs: N.m, N */
    double q[2];   /* states: rad, m */
    double dq[2];  /* states: rad/s, m/s */

    /* calculated from the above */
    double ddq[2];         /* rad/s2, m/s2 */
    double ee_position[2]; /* m, frame 0 */
    double ee_velocity[2]; /* m/s, frame 0 */
    double kinetic_energy; /* J */
    double potential_energy;
    double total_energy;
    double actuator_power; /* W */
    double D[2][2];
    double coriolis[2]; /* N.m, N */
    double gravity[2];  /* N.m, N */
    struct rp_joint_loads loads;
};

extern const struct model rp_model;
