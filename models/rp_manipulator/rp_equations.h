/* The equations of the notes, (1)-(15): kinematics and the Euler-Lagrange formulation. See
 * rp_manipulator.h for equation numbers, frames and symbols. A comment that begins with a number
 * stands above this equation of the notes. */
#pragma once

#include "../real.h"
#include "rp_manipulator.h"

/* The arm in a state, with what many equations share. */
struct arm {
    real m1, m2, I1z, I2z, l1, lc1, a, g; /* as in struct arm_parameters */
    real q[2], dq[2];

    real s1, c1; /* sin q1, cos q1 */
    real L;      /* l1 + q2 */
    real J;      /* m1 lc1^2 + I1z + I2z + m2 L^2 */
};

/* Inertia about z0 that does not depend on the slide, kg.m2. */
static inline real arm_fixed_inertia(const struct arm_parameters *p) {
    return p->m1 * p->lc1 * p->lc1 + p->I1z + p->I2z;
}

static inline struct arm arm_in_state(const struct arm_parameters *p, const real q[2],
                                      const real dq[2]) {
    const real s1 = sin(q[0]), c1 = cos(q[0]); // first: nothing is kept across these calls
    const real L = p->l1 + q[1];
    return (struct arm){
        .m1 = p->m1,
        .m2 = p->m2,
        .I1z = p->I1z,
        .I2z = p->I2z,
        .l1 = p->l1,
        .lc1 = p->lc1,
        .a = p->a,
        .g = p->g,
        .q = {q[0], q[1]},
        .dq = {dq[0], dq[1]},
        .s1 = s1,
        .c1 = c1,
        .L = L,
        .J = arm_fixed_inertia(p) + p->m2 * L * L,
    };
}

/* ---- Kinematics ----------------------------------------------------------------------------- */

/* (1), (2) Angular velocity Jacobian, the same for both links. */
static inline void arm_angular_jacobian(real Jw[3][2]) {
    for (int i = 0; i < 3; i++) {
        Jw[i][0] = i == 2 ? 1.0 : 0.0;
        Jw[i][1] = 0.0;
    }
}

/* (3) Linear velocity Jacobians of the centers of mass, without their rows of zeros. */
static inline void arm_link1_jacobian(const struct arm *arm, real Jv[2][2]) {
    Jv[0][0] = -arm->lc1 * arm->s1;
    Jv[0][1] = 0.0;
    Jv[1][0] = arm->lc1 * arm->c1;
    Jv[1][1] = 0.0;
}

static inline void arm_end_effector_jacobian(const struct arm *arm, real Jv[2][2]) {
    Jv[0][0] = -arm->L * arm->s1 - arm->a * arm->c1;
    Jv[0][1] = arm->c1;
    Jv[1][0] = arm->L * arm->c1 - arm->a * arm->s1;
    Jv[1][1] = arm->s1;
}

/* L along z1 = (c1, s1) and a along x1 = (-s1, c1). */
static inline void arm_end_effector_position(const struct arm *arm, real position[2]) {
    position[0] = arm->L * arm->c1 - arm->a * arm->s1;
    position[1] = arm->L * arm->s1 + arm->a * arm->c1;
}

static inline void arm_end_effector_velocity(const struct arm *arm, real velocity[2]) {
    const real dq1 = arm->dq[0], dq2 = arm->dq[1];
    real Jv[2][2];
    arm_end_effector_jacobian(arm, Jv);
    velocity[0] = Jv[0][0] * dq1 + Jv[0][1] * dq2;
    velocity[1] = Jv[1][0] * dq1 + Jv[1][1] * dq2;
}

/* ---- Terms of the equations of motion ------------------------------------------------------- */

/* (4)-(8) Mass matrix. Its first element is (6) with the powers of l1 + q2 collected in J.
 * Symmetric and positive definite, with the determinant m2 J. */
static inline void arm_mass_matrix(const struct arm *arm, real D[2][2]) {
    D[0][0] = arm->J + arm->m2 * arm->a * arm->a;
    D[0][1] = -arm->a * arm->m2;
    D[1][0] = D[0][1];
    D[1][1] = arm->m2;
}

/* (9) Christoffel symbols: c[i][j][k] is c_{(i+1)(j+1)(k+1)} of the notes, symmetric in i and j. */
static inline void arm_christoffel(const struct arm *arm, real c[2][2][2]) {
    const real m2L = arm->m2 * arm->L;
    c[0][0][0] = 0.0;
    c[0][0][1] = -m2L;
    c[0][1][0] = m2L;
    c[1][0][0] = m2L;
    c[0][1][1] = 0.0;
    c[1][0][1] = 0.0;
    c[1][1][0] = 0.0;
    c[1][1][1] = 0.0;
}

/* (10) Potential energy, 0 where both centers of mass are at the height of joint 1. */
static inline real arm_potential_energy(const struct arm *arm) {
    const real link1 = arm->m1 * arm->g * arm->lc1 * arm->s1;
    const real height2 = arm->l1 * arm->s1 + arm->a * arm->c1 + arm->q[1] * arm->s1;
    return link1 + arm->m2 * arm->g * height2;
}

/* (11) Gravity forces: derivatives of the potential energy by q. */
static inline void arm_gravity_forces(const struct arm *arm, real forces[2]) {
    const real link1 = arm->m1 * arm->g * arm->lc1 * arm->c1;
    const real lever2 = arm->l1 * arm->c1 - arm->a * arm->s1 + arm->q[1] * arm->c1;
    forces[0] = link1 + arm->m2 * arm->g * lever2;
    forces[1] = arm->m2 * arm->g * arm->s1;
}

/* (12) Coriolis matrix. dD/dt - 2 C is skew symmetric. */
static inline void arm_coriolis_matrix(const struct arm *arm, real C[2][2]) {
    real c[2][2][2];
    arm_christoffel(arm, c);
    C[0][0] = c[1][0][0] * arm->dq[1];
    C[0][1] = c[0][1][0] * arm->dq[0];
    C[1][0] = c[0][0][1] * arm->dq[0];
    C[1][1] = 0.0;
}

static inline void arm_coriolis_forces(const struct arm *arm, real forces[2]) {
    const real dq1 = arm->dq[0], dq2 = arm->dq[1];
    real C[2][2];
    arm_coriolis_matrix(arm, C);
    forces[0] = C[0][0] * dq1 + C[0][1] * dq2;
    forces[1] = C[1][0] * dq1 + C[1][1] * dq2;
}

/* Kinetic energy q'^T D q' / 2 as a sum of squares, which shows that it is never negative. Link 2
 * moves along the slide at q2' - a q1'. */
static inline real arm_kinetic_energy(const struct arm *arm) {
    const real dq1 = arm->dq[0], dq2 = arm->dq[1];
    const real along_slide = dq2 - arm->a * dq1;
    return 0.5 * (arm->J * dq1 * dq1 + arm->m2 * along_slide * along_slide);
}

/* ---- Equations of motion -------------------------------------------------------------------- */

/* (13)-(15) Efforts that a motion takes. */
static inline void arm_inverse_dynamics(const struct arm *arm, const real ddq[2], real tau[2]) {
    real D[2][2];
    real coriolis[2];
    real gravity[2];
    arm_mass_matrix(arm, D);
    arm_coriolis_forces(arm, coriolis);
    arm_gravity_forces(arm, gravity);
    for (int i = 0; i < 2; i++) {
        tau[i] = D[i][0] * ddq[0] + D[i][1] * ddq[1] + coriolis[i] + gravity[i];
    }
}

/* Solves the equations of motion for q''. The first row plus a times the second one eliminates q2''
 * and, in the gravity terms, the offset a; the second row is divided by m2.
 *
 * J > 0 for valid parameters, so no determinant is formed and nothing cancels. */
static inline void arm_forward_dynamics(const struct arm *arm, const real tau[2], real ddq[2]) {
    const real dq1 = arm->dq[0], dq2 = arm->dq[1];
    const real m2L = arm->m2 * arm->L;

    const real efforts = tau[0] + arm->a * tau[1];
    const real velocities = m2L * dq1 * (arm->a * dq1 - 2.0 * dq2);
    const real weight = arm->g * arm->c1 * (arm->m1 * arm->lc1 + m2L);
    ddq[0] = (efforts + velocities - weight) / arm->J;

    const real push = tau[1] / arm->m2;
    const real centrifugal = arm->L * dq1 * dq1;
    const real fall = arm->g * arm->s1;
    ddq[1] = push + centrifugal - fall + arm->a * ddq[0];
}

/* The same from parameters, states and inputs: the right side. */
static inline void arm_accelerations(const struct arm_parameters *p, const real q[2],
                                     const real dq[2], const real tau[2], real ddq[2]) {
    const struct arm arm = arm_in_state(p, q, dq);
    arm_forward_dynamics(&arm, tau, ddq);
}
