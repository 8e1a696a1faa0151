/* The right-hand side and the calculated fields of struct rp_values. */
#pragma once

#include "rp_model.h"
#include "rp_recursion.h"

/* Writes the derivatives of the states x = (q, dq) with the inputs u = tau. */
static inline void rp_right_hand_side(const struct rp_parameters *p, const real x[4],
                                      const real u[2], real dx[4]) {
    dx[0] = x[2];
    dx[1] = x[3];
    arm_accelerations(p, x, x + 2, u, dx + 2);
}

/* Writes the calculated fields from the parameters, inputs and states. */
static inline void rp_calculate(struct rp_values *values) {
    const real *tau = values->tau;
    const real *dq = values->dq;
    const struct arm arm = arm_in_state(&values->parameters, values->q, dq);
    arm_forward_dynamics(&arm, tau, values->ddq);

    // end effector
    arm_end_effector_position(&arm, values->ee_position);
    arm_end_effector_velocity(&arm, values->ee_velocity);

    // energies
    values->kinetic_energy = arm_kinetic_energy(&arm);
    values->potential_energy = arm_potential_energy(&arm);
    values->total_energy = values->kinetic_energy + values->potential_energy;
    values->actuator_power = tau[0] * dq[0] + tau[1] * dq[1];

    // terms of the equations of motion
    arm_mass_matrix(&arm, values->D);
    arm_coriolis_forces(&arm, values->coriolis);
    arm_gravity_forces(&arm, values->gravity);

    const struct joint_loads loads = loads_of_motion(&arm, tau, values->ddq);
    write_loads(&loads, &values->loads);
}

/* Derived: J[i + 4 j] is the derivative of dx[i] by x[j]. */
void rp_jacobian(const struct rp_parameters *p, const double x[4], const double u[2], double J[]);

/* Derived: first and, unless NULL, second derivatives of the calculated fields along a curve.
 * The other fields of first and second give the curve. */
void rp_derivatives(const struct rp_values *values, struct rp_values *first,
                    struct rp_values *second);
