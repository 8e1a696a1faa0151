#include "rp_propagation.h"

#include "taylor.h"

#include <stddef.h>

/* The parameters, inputs and states on the curve, and what several equations share. */
struct arm {
    struct taylor m1, m2, I1z, I2z, l1, lc1, a, g;
    struct taylor tau[2], q[2], dq[2];

    struct taylor s1, c1;
    struct taylor L; /* l1 + q2 */
    struct taylor J; /* m1 lc1^2 + I1z + I2z + m2 L^2 */
    struct taylor ddq[2];
};

/* (14) plus a times (15), and (15), as above rp_forward_dynamics. */
static void accelerations(struct arm *arm) {
    const struct taylor m2L = taylor_product(arm->m2, arm->L);
    const struct taylor lever = taylor_sum(taylor_product(arm->m1, arm->lc1), m2L);
    const struct taylor velocities =
        taylor_difference(taylor_product(arm->a, arm->dq[0]), taylor_scaled(2.0, arm->dq[1]));

    const struct taylor efforts = taylor_sum(arm->tau[0], taylor_product(arm->a, arm->tau[1]));
    const struct taylor inertial = taylor_product(taylor_product(m2L, arm->dq[0]), velocities);
    const struct taylor weight = taylor_product(taylor_product(arm->g, arm->c1), lever);
    const struct taylor torque = taylor_difference(taylor_sum(efforts, inertial), weight);
    arm->ddq[0] = taylor_quotient(torque, arm->J);

    const struct taylor push = taylor_quotient(arm->tau[1], arm->m2);
    const struct taylor centrifugal = taylor_product(arm->L, taylor_square(arm->dq[0]));
    const struct taylor fall = taylor_product(arm->g, arm->s1);
    arm->ddq[1] = taylor_sum(taylor_difference(taylor_sum(push, centrifugal), fall),
                             taylor_product(arm->a, arm->ddq[0]));
}

static struct arm arm_on_curve(const struct rp_values *values, const struct rp_values *first,
                               const struct rp_values *second) {
    const struct rp_parameters *p = &values->parameters;
    const struct rp_parameters *dp = &first->parameters;
    const struct rp_parameters *ddp = &second->parameters;
    struct arm arm = {
        .m1 = {p->m1, dp->m1, ddp->m1},
        .m2 = {p->m2, dp->m2, ddp->m2},
        .I1z = {p->I1z, dp->I1z, ddp->I1z},
        .I2z = {p->I2z, dp->I2z, ddp->I2z},
        .l1 = {p->l1, dp->l1, ddp->l1},
        .lc1 = {p->lc1, dp->lc1, ddp->lc1},
        .a = {p->a, dp->a, ddp->a},
        .g = {p->g, dp->g, ddp->g},
    };
    for (int i = 0; i < 2; i++) {
        arm.tau[i] = (struct taylor){values->tau[i], first->tau[i], second->tau[i]};
        arm.q[i] = (struct taylor){values->q[i], first->q[i], second->q[i]};
        arm.dq[i] = (struct taylor){values->dq[i], first->dq[i], second->dq[i]};
    }

    arm.s1 = taylor_sine(arm.q[0]);
    arm.c1 = taylor_cosine(arm.q[0]);
    arm.L = taylor_sum(arm.l1, arm.q[1]);
    const struct taylor link1 = taylor_product(arm.m1, taylor_square(arm.lc1));
    const struct taylor fixed = taylor_sum(taylor_sum(link1, arm.I1z), arm.I2z);
    arm.J = taylor_sum(fixed, taylor_product(arm.m2, taylor_square(arm.L)));
    accelerations(&arm);
    return arm;
}

static void put(struct taylor x, double *first, double *second) {
    *first = x.first;
    *second = x.second;
}

/* L along z1 = (c1, s1) and a along x1 = (-s1, c1); with the rates of both, (3). */
static void end_effector(const struct arm *arm, struct rp_values *first, struct rp_values *second) {
    const struct taylor x =
        taylor_difference(taylor_product(arm->L, arm->c1), taylor_product(arm->a, arm->s1));
    const struct taylor y =
        taylor_sum(taylor_product(arm->L, arm->s1), taylor_product(arm->a, arm->c1));
    const struct taylor vx =
        taylor_difference(taylor_product(arm->c1, arm->dq[1]), taylor_product(y, arm->dq[0]));
    const struct taylor vy =
        taylor_sum(taylor_product(arm->s1, arm->dq[1]), taylor_product(x, arm->dq[0]));

    put(x, &first->ee_position[0], &second->ee_position[0]);
    put(y, &first->ee_position[1], &second->ee_position[1]);
    put(vx, &first->ee_velocity[0], &second->ee_velocity[0]);
    put(vy, &first->ee_velocity[1], &second->ee_velocity[1]);
}

/* K = (J dq1^2 + m2 (dq2 - a dq1)^2) / 2 and P = g (m1 lc1 s1 + m2 (L s1 + a c1)), (10). */
static void energies(const struct arm *arm, struct rp_values *first, struct rp_values *second) {
    const struct taylor along_slide =
        taylor_difference(arm->dq[1], taylor_product(arm->a, arm->dq[0]));
    const struct taylor turning = taylor_product(arm->J, taylor_square(arm->dq[0]));
    const struct taylor sliding = taylor_product(arm->m2, taylor_square(along_slide));
    const struct taylor kinetic = taylor_scaled(0.5, taylor_sum(turning, sliding));

    const struct taylor y1 = taylor_product(arm->lc1, arm->s1);
    const struct taylor y2 =
        taylor_sum(taylor_product(arm->L, arm->s1), taylor_product(arm->a, arm->c1));
    const struct taylor moment =
        taylor_sum(taylor_product(arm->m1, y1), taylor_product(arm->m2, y2));
    const struct taylor potential = taylor_product(arm->g, moment);

    const struct taylor power = taylor_sum(taylor_product(arm->tau[0], arm->dq[0]),
                                           taylor_product(arm->tau[1], arm->dq[1]));

    put(kinetic, &first->kinetic_energy, &second->kinetic_energy);
    put(potential, &first->potential_energy, &second->potential_energy);
    put(taylor_sum(kinetic, potential), &first->total_energy, &second->total_energy);
    put(power, &first->actuator_power, &second->actuator_power);
}

/* D (6)-(8), C dq of (14) and (15), g(q) (11). */
static void terms(const struct arm *arm, struct rp_values *first, struct rp_values *second) {
    const struct taylor m2 = arm->m2;
    const struct taylor d11 = taylor_sum(arm->J, taylor_product(m2, taylor_square(arm->a)));
    const struct taylor d12 = taylor_scaled(-1.0, taylor_product(arm->a, m2));
    put(d11, &first->D[0][0], &second->D[0][0]);
    put(d12, &first->D[0][1], &second->D[0][1]);
    put(d12, &first->D[1][0], &second->D[1][0]);
    put(m2, &first->D[1][1], &second->D[1][1]);

    const struct taylor c121_dq1 = taylor_product(taylor_product(m2, arm->L), arm->dq[0]);
    const struct taylor coriolis1 = taylor_scaled(2.0, taylor_product(c121_dq1, arm->dq[1]));
    const struct taylor coriolis2 = taylor_scaled(-1.0, taylor_product(c121_dq1, arm->dq[0]));
    put(coriolis1, &first->coriolis[0], &second->coriolis[0]);
    put(coriolis2, &first->coriolis[1], &second->coriolis[1]);

    const struct taylor x1 = taylor_product(arm->lc1, arm->c1);
    const struct taylor x2 =
        taylor_difference(taylor_product(arm->L, arm->c1), taylor_product(arm->a, arm->s1));
    const struct taylor moment = taylor_sum(taylor_product(arm->m1, x1), taylor_product(m2, x2));
    const struct taylor gravity1 = taylor_product(arm->g, moment);
    const struct taylor gravity2 = taylor_product(taylor_product(m2, arm->g), arm->s1);
    put(gravity1, &first->gravity[0], &second->gravity[0]);
    put(gravity2, &first->gravity[1], &second->gravity[1]);
}

/* Loads in the plane of motion: (20) and (23) with the corrected (24), and (21). Along every curve
 * of motions the loads that drive the joints are the efforts, (26) and (27); written so, what would
 * cancel between the terms of (22) and (25) does not arise. */
static void joint_loads(const struct arm *arm, struct rp_values *first, struct rp_values *second) {
    const struct taylor gx = taylor_product(arm->g, arm->c1);
    const struct taylor gz = taylor_product(arm->g, arm->s1);
    const struct taylor dq1_squared = taylor_square(arm->dq[0]);

    const struct taylor turning =
        taylor_difference(taylor_product(arm->L, arm->ddq[0]), taylor_product(arm->a, dq1_squared));
    const struct taylor coriolis = taylor_scaled(2.0, taylor_product(arm->dq[0], arm->dq[1]));
    const struct taylor ac2_x = taylor_sum(turning, coriolis);
    const struct taylor f2_x = taylor_product(arm->m2, taylor_sum(ac2_x, gx));
    const struct taylor f2_z = arm->tau[1];
    const struct taylor tau2_y =
        taylor_sum(taylor_product(arm->q[1], f2_x), taylor_product(arm->I2z, arm->ddq[0]));

    const struct taylor ac1_x = taylor_product(arm->lc1, arm->ddq[0]);
    const struct taylor ac1_z = taylor_scaled(-1.0, taylor_product(arm->lc1, dq1_squared));
    const struct taylor f1_x = taylor_sum(f2_x, taylor_product(arm->m1, taylor_sum(ac1_x, gx)));
    const struct taylor f1_z = taylor_sum(f2_z, taylor_product(arm->m1, taylor_sum(ac1_z, gz)));
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
    end_effector(&arm, first, second);
    energies(&arm, first, second);
    terms(&arm, first, second);
    joint_loads(&arm, first, second);
}
