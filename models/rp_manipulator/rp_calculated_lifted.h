/* The calculated fields of struct rp_values, in any arithmetic (equation.h). */
#ifndef RP_CALCULATED_LIFTED_H
#define RP_CALCULATED_LIFTED_H

#include "rp_model.h"
#include "rp_recursion_lifted.h"

/* The loads that drive the joints are the efforts along every curve of motions, (26) and (27). They
 * take their derivatives from there: what would cancel between the terms of (22) and (25) does not
 * arise. */
EQUATION struct joint_loads loads_of_motion(const struct arm *arm, const real tau[2],
                                            const real ddq[2]) {
    const struct link_motion motion = link_motion(arm, ddq);
    struct joint_loads loads;
    link2_loads(arm, &motion, &loads);
    loads.f2.z = moving_as(loads.f2.z, tau[1]);
    link1_loads(arm, &motion, &loads);
    loads.tau1.y = moving_as(loads.tau1.y, tau[0]);
    return loads;
}

EQUATION void write_loads(struct rp_values *const to[TARGETS], const struct joint_loads *loads) {
    WRITE(to, loads.f1[0], loads->f1.x);
    WRITE(to, loads.f1[1], loads->f1.y);
    WRITE(to, loads.f1[2], loads->f1.z);
    WRITE(to, loads.tau1[0], loads->tau1.x);
    WRITE(to, loads.tau1[1], loads->tau1.y);
    WRITE(to, loads.tau1[2], loads->tau1.z);
    WRITE(to, loads.f2[0], loads->f2.x);
    WRITE(to, loads.f2[1], loads->f2.y);
    WRITE(to, loads.f2[2], loads->f2.z);
    WRITE(to, loads.tau2[0], loads->tau2.x);
    WRITE(to, loads.tau2[1], loads->tau2.y);
    WRITE(to, loads.tau2[2], loads->tau2.z);
}

/* From the parameters, inputs and states. */
EQUATION void calculate(const struct rp_values *const from[SOURCES],
                        struct rp_values *const to[TARGETS]) {
    const struct rp_parameters *const parameters[SOURCES] = PARTS(from, parameters);
    const real q[2] = {READ(from, q[0]), READ(from, q[1])};
    const real dq[2] = {READ(from, dq[0]), READ(from, dq[1])};
    const real tau[2] = {READ(from, tau[0]), READ(from, tau[1])};
    const struct arm arm = arm_in_state(parameters, q, dq);

    real ddq[2];
    arm_forward_dynamics(&arm, tau, ddq);
    WRITE(to, ddq[0], ddq[0]);
    WRITE(to, ddq[1], ddq[1]);

    // end effector
    real position[2];
    real velocity[2];
    arm_end_effector_position(&arm, position);
    arm_end_effector_velocity(&arm, velocity);
    WRITE(to, ee_position[0], position[0]);
    WRITE(to, ee_position[1], position[1]);
    WRITE(to, ee_velocity[0], velocity[0]);
    WRITE(to, ee_velocity[1], velocity[1]);

    // energies
    const real kinetic_energy = arm_kinetic_energy(&arm);
    const real potential_energy = arm_potential_energy(&arm);
    WRITE(to, kinetic_energy, kinetic_energy);
    WRITE(to, potential_energy, potential_energy);
    WRITE(to, total_energy, plus(kinetic_energy, potential_energy));
    WRITE(to, actuator_power, plus(times(tau[0], dq[0]), times(tau[1], dq[1])));

    // terms of the equations of motion
    real D[2][2];
    real coriolis[2];
    real gravity[2];
    arm_mass_matrix(&arm, D);
    arm_coriolis_forces(&arm, coriolis);
    arm_gravity_forces(&arm, gravity);
    WRITE(to, D[0][0], D[0][0]);
    WRITE(to, D[0][1], D[0][1]);
    WRITE(to, D[1][0], D[1][0]);
    WRITE(to, D[1][1], D[1][1]);
    WRITE(to, coriolis[0], coriolis[0]);
    WRITE(to, coriolis[1], coriolis[1]);
    WRITE(to, gravity[0], gravity[0]);
    WRITE(to, gravity[1], gravity[1]);

    const struct joint_loads loads = loads_of_motion(&arm, tau, ddq);
    write_loads(to, &loads);
}

#endif
