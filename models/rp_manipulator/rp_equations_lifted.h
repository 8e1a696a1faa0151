/* The equations of the notes, (3) and (6)-(15), in any arithmetic (equation.h): rp_manipulator.h is
 * these with doubles, and says what they mean. */
#ifndef RP_EQUATIONS_LIFTED_H
#define RP_EQUATIONS_LIFTED_H

#include "equation.h"
#include "rp_manipulator.h"

/* The arm in a state, with what many equations share. */
struct arm {
    real m1, m2, I1z, I2z, l1, lc1, a, g; /* as in struct rp_parameters */
    real q[2], dq[2];

    real s1, c1; /* sin q1, cos q1 */
    real L;      /* l1 + q2 */
    real J;      /* m1 lc1^2 + I1z + I2z + m2 L^2 */
};

/* m1 lc1^2 + I1z + I2z */
EQUATION real arm_fixed_inertia(const struct rp_parameters *const p[SOURCES]) {
    const real link1 = times(times(READ(p, m1), READ(p, lc1)), READ(p, lc1));
    return plus(plus(link1, READ(p, I1z)), READ(p, I2z));
}

EQUATION struct arm arm_in_state(const struct rp_parameters *const p[SOURCES], const real q[2],
                                 const real dq[2]) {
    const real s1 = sine(q[0]);
    const real c1 = cosine(q[0]);
    const real L = plus(READ(p, l1), q[1]);
    return (struct arm){
        .m1 = READ(p, m1),
        .m2 = READ(p, m2),
        .I1z = READ(p, I1z),
        .I2z = READ(p, I2z),
        .l1 = READ(p, l1),
        .lc1 = READ(p, lc1),
        .a = READ(p, a),
        .g = READ(p, g),
        .q = {q[0], q[1]},
        .dq = {dq[0], dq[1]},
        .s1 = s1,
        .c1 = c1,
        .L = L,
        .J = plus(arm_fixed_inertia(p), times(times(READ(p, m2), L), L)),
    };
}

/* ---- End effector --------------------------------------------------------------------------- */

/* x = L c1 - a s1,  y = L s1 + a c1: L along z1 = (c1, s1) and a along x1 = (-s1, c1) */
EQUATION void arm_end_effector_position(const struct arm *arm, real position[2]) {
    position[0] = minus(times(arm->L, arm->c1), times(arm->a, arm->s1));
    position[1] = plus(times(arm->L, arm->s1), times(arm->a, arm->c1));
}

/* (3) of link 2 without its row of zeros:  Jv = [[-L s1 - a c1, c1], [L c1 - a s1, s1]] */
EQUATION void arm_end_effector_jacobian(const struct arm *arm, real Jv[2][2]) {
    Jv[0][0] = minus(times(negative(arm->L), arm->s1), times(arm->a, arm->c1));
    Jv[0][1] = arm->c1;
    Jv[1][0] = minus(times(arm->L, arm->c1), times(arm->a, arm->s1));
    Jv[1][1] = arm->s1;
}

/* Jv q' */
EQUATION void arm_end_effector_velocity(const struct arm *arm, real velocity[2]) {
    real Jv[2][2];
    arm_end_effector_jacobian(arm, Jv);
    velocity[0] = plus(times(Jv[0][0], arm->dq[0]), times(Jv[0][1], arm->dq[1]));
    velocity[1] = plus(times(Jv[1][0], arm->dq[0]), times(Jv[1][1], arm->dq[1]));
}

/* ---- Terms of the equations of motion ------------------------------------------------------- */

/* (6)-(8):  d11 = J + m2 a^2,  d12 = d21 = -a m2,  d22 = m2 */
EQUATION void arm_mass_matrix(const struct arm *arm, real D[2][2]) {
    D[0][0] = plus(arm->J, times(times(arm->m2, arm->a), arm->a));
    D[0][1] = times(negative(arm->a), arm->m2);
    D[1][0] = D[0][1];
    D[1][1] = arm->m2;
}

/* (9):  c121 = c211 = m2 L,  c112 = -m2 L,  all others 0 */
EQUATION void arm_christoffel(const struct arm *arm, real c[2][2][2]) {
    const real zero = constant(0.0);
    const real m2L = times(arm->m2, arm->L);
    c[0][0][0] = zero;
    c[0][0][1] = negative(m2L);
    c[0][1][0] = m2L;
    c[1][0][0] = m2L;
    c[0][1][1] = zero;
    c[1][0][1] = zero;
    c[1][1][0] = zero;
    c[1][1][1] = zero;
}

/* (12):  C = [[c211 q2', c121 q1'], [c112 q1', 0]] */
EQUATION void arm_coriolis_matrix(const struct arm *arm, real C[2][2]) {
    real c[2][2][2];
    arm_christoffel(arm, c);

    C[0][0] = times(c[1][0][0], arm->dq[1]);
    C[0][1] = times(c[0][1][0], arm->dq[0]);
    C[1][0] = times(c[0][0][1], arm->dq[0]);
    C[1][1] = constant(0.0);
}

/* C q' */
EQUATION void arm_coriolis_forces(const struct arm *arm, real forces[2]) {
    real C[2][2];
    arm_coriolis_matrix(arm, C);
    forces[0] = plus(times(C[0][0], arm->dq[0]), times(C[0][1], arm->dq[1]));
    forces[1] = plus(times(C[1][0], arm->dq[0]), times(C[1][1], arm->dq[1]));
}

/* (10):  P = m1 g lc1 s1 + m2 g (l1 s1 + a c1 + q2 s1) */
EQUATION real arm_potential_energy(const struct arm *arm) {
    const real link1 = times(times(times(arm->m1, arm->g), arm->lc1), arm->s1);
    const real height2 =
        plus(plus(times(arm->l1, arm->s1), times(arm->a, arm->c1)), times(arm->q[1], arm->s1));
    return plus(link1, times(times(arm->m2, arm->g), height2));
}

/* (11):  g1 = m1 g lc1 c1 + m2 g (l1 c1 - a s1 + q2 c1),  g2 = m2 g s1 */
EQUATION void arm_gravity_forces(const struct arm *arm, real forces[2]) {
    const real link1 = times(times(times(arm->m1, arm->g), arm->lc1), arm->c1);
    const real lever2 =
        plus(minus(times(arm->l1, arm->c1), times(arm->a, arm->s1)), times(arm->q[1], arm->c1));
    forces[0] = plus(link1, times(times(arm->m2, arm->g), lever2));
    forces[1] = times(times(arm->m2, arm->g), arm->s1);
}

/* K = q'^T D q' / 2 = (J q1'^2 + m2 (q2' - a q1')^2) / 2: the sum of squares shows that it is never
 * negative. Link 2 moves along the slide at q2' - a q1'. */
EQUATION real arm_kinetic_energy(const struct arm *arm) {
    const real along_slide = minus(arm->dq[1], times(arm->a, arm->dq[0]));
    const real turning = times(times(arm->J, arm->dq[0]), arm->dq[0]);
    const real sliding = times(times(arm->m2, along_slide), along_slide);
    return scaled(0.5, plus(turning, sliding));
}

/* ---- Equations of motion -------------------------------------------------------------------- */

/* (13):  tau = D q'' + C q' + g(q), whose rows (14) and (15) write out */
EQUATION void arm_inverse_dynamics(const struct arm *arm, const real ddq[2], real tau[2]) {
    real D[2][2];
    real coriolis[2];
    real gravity[2];
    arm_mass_matrix(arm, D);
    arm_coriolis_forces(arm, coriolis);
    arm_gravity_forces(arm, gravity);

    for (int i = 0; i < 2; i++) {
        const real inertial = plus(times(D[i][0], ddq[0]), times(D[i][1], ddq[1]));
        tau[i] = plus(plus(inertial, coriolis[i]), gravity[i]);
    }
}

/* (13) solved for q''. (14) plus a times (15) eliminates q2'' and, in the gravity terms, the offset
 * a; the second line is (15) divided by m2:
 *
 *   J q1'' = tau1 + a f2 + m2 L q1' (a q1' - 2 q2') - g c1 (m1 lc1 + m2 L)
 *     q2'' = f2 / m2 + L q1'^2 - g s1 + a q1''
 *
 * J > 0 for valid parameters, so no determinant is formed and nothing cancels. */
EQUATION void arm_forward_dynamics(const struct arm *arm, const real tau[2], real ddq[2]) {
    const real dq1 = arm->dq[0];
    const real dq2 = arm->dq[1];
    const real m2L = times(arm->m2, arm->L);

    const real efforts = plus(tau[0], times(arm->a, tau[1]));
    const real velocities = times(times(m2L, dq1), minus(times(arm->a, dq1), scaled(2.0, dq2)));
    const real weight = times(times(arm->g, arm->c1), plus(times(arm->m1, arm->lc1), m2L));
    ddq[0] = quotient(minus(plus(efforts, velocities), weight), arm->J);

    const real push = quotient(tau[1], arm->m2);
    const real centrifugal = times(times(arm->L, dq1), dq1);
    const real fall = times(arm->g, arm->s1);
    ddq[1] = plus(minus(plus(push, centrifugal), fall), times(arm->a, ddq[0]));
}

#endif
