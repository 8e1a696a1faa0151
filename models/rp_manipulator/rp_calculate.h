/* What RPManipulator calculates of its parameters, inputs and states. */
#pragma once

#include "rp_manipulator_values.h"
#include "rp_recursion.h"

/* Writes the fields that have no value in rp_manipulator.toml. */
static inline void rp_manipulator_calculate(struct rp_manipulator_values *values) {
    const real q[2] = {values->q1, values->q2};
    const real dq[2] = {values->dq1, values->dq2};
    const real tau[2] = {values->tau1, values->f2};
    const struct arm arm = arm_in_state(&values->parameters.arm, q, dq);
    real ddq[2];
    arm_forward_dynamics(&arm, tau, ddq);
    values->ddq1 = ddq[0];
    values->ddq2 = ddq[1];

    // end effector
    real position[2];
    real velocity[2];
    arm_end_effector_position(&arm, position);
    arm_end_effector_velocity(&arm, velocity);
    values->ee_x = position[0];
    values->ee_y = position[1];
    values->ee_vx = velocity[0];
    values->ee_vy = velocity[1];

    // energies
    values->kinetic_energy = arm_kinetic_energy(&arm);
    values->potential_energy = arm_potential_energy(&arm);
    values->total_energy = values->kinetic_energy + values->potential_energy;
    values->actuator_power = tau[0] * dq[0] + tau[1] * dq[1];

    // terms of the equations of motion
    real D[2][2];
    real coriolis[2];
    real gravity[2];
    arm_mass_matrix(&arm, D);
    arm_coriolis_forces(&arm, coriolis);
    arm_gravity_forces(&arm, gravity);
    values->D11 = D[0][0];
    values->D12 = D[0][1];
    values->D22 = D[1][1];
    values->coriolis1 = coriolis[0];
    values->coriolis2 = coriolis[1];
    values->gravity1 = gravity[0];
    values->gravity2 = gravity[1];

    // loads of the joints
    const struct joint_loads loads = loads_of_motion(&arm, tau, ddq);
    values->f1_x = loads.f1.x;
    values->f1_z = loads.f1.z;
    values->tau1_y = loads.tau1.y;
    values->f2_x = loads.f2.x;
    values->f2_z = loads.f2.z;
    values->tau2_y = loads.tau2.y;
}
