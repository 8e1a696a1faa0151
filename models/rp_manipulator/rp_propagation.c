#include "rp_propagation.h"

#include "rp_curve.h"

#include <stddef.h>

/* The arm with its efforts on the curve, and the accelerations that follow. */
struct arm {
    struct rp_curve curve;
    struct taylor tau[2], ddq[2];
};

/* (14) plus a times (15), and (15), as above rp_forward_dynamics. */
static void accelerations(struct arm *arm) {
    const struct rp_curve *curve = &arm->curve;
    const struct taylor m2L = taylor_product(curve->m2, curve->L);
    const struct taylor lever = taylor_sum(taylor_product(curve->m1, curve->lc1), m2L);
    const struct taylor velocities =
        taylor_difference(taylor_product(curve->a, curve->dq[0]), taylor_scaled(2.0, curve->dq[1]));

    const struct taylor efforts = taylor_sum(arm->tau[0], taylor_product(curve->a, arm->tau[1]));
    const struct taylor inertial = taylor_product(taylor_product(m2L, curve->dq[0]), velocities);
    const struct taylor weight = taylor_product(taylor_product(curve->g, curve->c1), lever);
    const struct taylor torque = taylor_difference(taylor_sum(efforts, inertial), weight);
    arm->ddq[0] = taylor_quotient(torque, curve->J);

    const struct taylor push = taylor_quotient(arm->tau[1], curve->m2);
    const struct taylor centrifugal = taylor_product(curve->L, taylor_square(curve->dq[0]));
    const struct taylor fall = taylor_product(curve->g, curve->s1);
    arm->ddq[1] = taylor_sum(taylor_difference(taylor_sum(push, centrifugal), fall),
                             taylor_product(curve->a, arm->ddq[0]));
}

static struct arm arm_on_curve(const struct rp_values *values, const struct rp_values *first,
                               const struct rp_values *second) {
    const struct rp_parameters *const parameters[3] = {&values->parameters, &first->parameters,
                                                       &second->parameters};
    const double *const q[3] = {values->q, first->q, second->q};
    const double *const dq[3] = {values->dq, first->dq, second->dq};
    struct arm arm = {.curve = rp_curve_of(parameters, q, dq)};
    for (int i = 0; i < 2; i++) {
        arm.tau[i] = (struct taylor){values->tau[i], first->tau[i], second->tau[i]};
    }
    accelerations(&arm);
    return arm;
}

static void put(struct taylor x, double *first, double *second) {
    *first = x.first;
    *second = x.second;
}

/* L along z1 = (c1, s1) and a along x1 = (-s1, c1); with the rates of both, (3). */
static void end_effector(const struct rp_curve *curve, struct rp_values *first,
                         struct rp_values *second) {
    const struct taylor x =
        taylor_difference(taylor_product(curve->L, curve->c1), taylor_product(curve->a, curve->s1));
    const struct taylor y =
        taylor_sum(taylor_product(curve->L, curve->s1), taylor_product(curve->a, curve->c1));
    const struct taylor vx =
        taylor_difference(taylor_product(curve->c1, curve->dq[1]), taylor_product(y, curve->dq[0]));
    const struct taylor vy =
        taylor_sum(taylor_product(curve->s1, curve->dq[1]), taylor_product(x, curve->dq[0]));

    put(x, &first->ee_position[0], &second->ee_position[0]);
    put(y, &first->ee_position[1], &second->ee_position[1]);
    put(vx, &first->ee_velocity[0], &second->ee_velocity[0]);
    put(vy, &first->ee_velocity[1], &second->ee_velocity[1]);
}

/* K = (J dq1^2 + m2 (dq2 - a dq1)^2) / 2 and P = g (m1 lc1 s1 + m2 (L s1 + a c1)), (10). */
static void energies(const struct arm *arm, struct rp_values *first, struct rp_values *second) {
    const struct rp_curve *curve = &arm->curve;
    const struct taylor along_slide =
        taylor_difference(curve->dq[1], taylor_product(curve->a, curve->dq[0]));
    const struct taylor turning = taylor_product(curve->J, taylor_square(curve->dq[0]));
    const struct taylor sliding = taylor_product(curve->m2, taylor_square(along_slide));
    const struct taylor kinetic = taylor_scaled(0.5, taylor_sum(turning, sliding));

    const struct taylor y1 = taylor_product(curve->lc1, curve->s1);
    const struct taylor y2 =
        taylor_sum(taylor_product(curve->L, curve->s1), taylor_product(curve->a, curve->c1));
    const struct taylor moment =
        taylor_sum(taylor_product(curve->m1, y1), taylor_product(curve->m2, y2));
    const struct taylor potential = taylor_product(curve->g, moment);

    const struct taylor power = taylor_sum(taylor_product(arm->tau[0], curve->dq[0]),
                                           taylor_product(arm->tau[1], curve->dq[1]));

    put(kinetic, &first->kinetic_energy, &second->kinetic_energy);
    put(potential, &first->potential_energy, &second->potential_energy);
    put(taylor_sum(kinetic, potential), &first->total_energy, &second->total_energy);
    put(power, &first->actuator_power, &second->actuator_power);
}

static void terms(const struct rp_curve *curve, struct rp_values *first, struct rp_values *second) {
    struct taylor D[2][2];
    struct taylor coriolis[2];
    struct taylor gravity[2];
    rp_curve_mass_matrix(curve, D);
    rp_curve_coriolis_forces(curve, coriolis);
    rp_curve_gravity_forces(curve, gravity);
    for (int i = 0; i < 2; i++) {
        put(D[i][0], &first->D[i][0], &second->D[i][0]);
        put(D[i][1], &first->D[i][1], &second->D[i][1]);
        put(coriolis[i], &first->coriolis[i], &second->coriolis[i]);
        put(gravity[i], &first->gravity[i], &second->gravity[i]);
    }
}

/* Loads in the plane of motion: (20) and (23) with the corrected (24), and (21). Along every curve
 * of motions the loads that drive the joints are the efforts, (26) and (27); written so, what would
 * cancel between the terms of (22) and (25) does not arise. */
static void joint_loads(const struct arm *arm, struct rp_values *first, struct rp_values *second) {
    const struct rp_curve *curve = &arm->curve;
    const struct taylor gx = taylor_product(curve->g, curve->c1);
    const struct taylor gz = taylor_product(curve->g, curve->s1);
    const struct taylor dq1_squared = taylor_square(curve->dq[0]);

    const struct taylor turning = taylor_difference(taylor_product(curve->L, arm->ddq[0]),
                                                    taylor_product(curve->a, dq1_squared));
    const struct taylor coriolis = taylor_scaled(2.0, taylor_product(curve->dq[0], curve->dq[1]));
    const struct taylor ac2_x = taylor_sum(turning, coriolis);
    const struct taylor f2_x = taylor_product(curve->m2, taylor_sum(ac2_x, gx));
    const struct taylor f2_z = arm->tau[1];
    const struct taylor tau2_y =
        taylor_sum(taylor_product(curve->q[1], f2_x), taylor_product(curve->I2z, arm->ddq[0]));

    const struct taylor ac1_x = taylor_product(curve->lc1, arm->ddq[0]);
    const struct taylor ac1_z = taylor_scaled(-1.0, taylor_product(curve->lc1, dq1_squared));
    const struct taylor f1_x = taylor_sum(f2_x, taylor_product(curve->m1, taylor_sum(ac1_x, gx)));
    const struct taylor f1_z = taylor_sum(f2_z, taylor_product(curve->m1, taylor_sum(ac1_z, gz)));
    const struct taylor tau1_y = arm->tau[0];

    first->loads = second->loads = (struct rp_joint_loads){0};
    put(f1_x, &first->loads.f1[0], &second->loads.f1[0]);
    put(f1_z, &first->loads.f1[2], &second->loads.f1[2]);
    put(tau1_y, &first->loads.tau1[1], &second->loads.tau1[1]);
    put(f2_x, &first->loads.f2[0], &second->loads.f2[0]);
    put(f2_z, &first->loads.f2[2], &second->loads.f2[2]);
    put(tau2_y, &first->loads.tau2[1], &second->loads.tau2[1]);
}

void rp_propagate(const struct rp_values *values, struct rp_values *first,
                  struct rp_values *second) {
    struct rp_values straight = {0};
    if (second == NULL) {
        second = &straight;
    }

    const struct arm arm = arm_on_curve(values, first, second);
    for (int i = 0; i < 2; i++) {
        put(arm.ddq[i], &first->ddq[i], &second->ddq[i]);
    }
    end_effector(&arm.curve, first, second);
    energies(&arm, first, second);
    terms(&arm.curve, first, second);
    joint_loads(&arm, first, second);
}
