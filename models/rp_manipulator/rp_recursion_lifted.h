/* The Newton-Euler recursion (16)-(25) in any arithmetic (equation.h): rp_newton_euler.c is this
 * with doubles. It shares no equation of motion with rp_equations.h, which it checks. */
#ifndef RP_RECURSION_LIFTED_H
#define RP_RECURSION_LIFTED_H

#include "rp_equations_lifted.h"

/* In the frame of a link; those of links 1 and 2 are parallel. */
struct vector {
    real x, y, z;
};

/* Struct rp_link_motion and struct rp_joint_loads. */
struct link_motion {
    struct vector omega, domega, ac1, ae1, ac2;
};

struct joint_loads {
    struct vector f1, tau1, f2, tau2;
};

/* ---- Vectors -------------------------------------------------------------------------------- */

EQUATION struct vector vector_plus(struct vector u, struct vector v) {
    return (struct vector){plus(u.x, v.x), plus(u.y, v.y), plus(u.z, v.z)};
}

EQUATION struct vector vector_minus(struct vector u, struct vector v) {
    return (struct vector){minus(u.x, v.x), minus(u.y, v.y), minus(u.z, v.z)};
}

EQUATION struct vector vector_scaled(real factor, struct vector v) {
    return (struct vector){times(factor, v.x), times(factor, v.y), times(factor, v.z)};
}

EQUATION struct vector vector_cross(struct vector u, struct vector v) {
    return (struct vector){
        .x = minus(times(u.y, v.z), times(u.z, v.y)),
        .y = minus(times(u.z, v.x), times(u.x, v.z)),
        .z = minus(times(u.x, v.y), times(u.y, v.x)),
    };
}

/* ---- Forward -------------------------------------------------------------------------------- */

/* omega' x r + omega x (omega x r): acceleration of a point fixed to a body whose origin does not
 * accelerate. */
EQUATION struct vector rigid_acceleration(struct vector omega, struct vector domega,
                                          struct vector r) {
    const struct vector centripetal = vector_cross(omega, vector_cross(omega, r));
    return vector_plus(vector_cross(domega, r), centripetal);
}

/* Both links turn about y1 = y2 = z0. (16) and (17) are the accelerations of points of link 1, and
 *
 *   (18):  ac2 = ae1 + omega' x r + omega x (omega x r) + q2'' z1 + 2 omega x q2' z1,
 *
 * r being q2 z1; of the last term the notes have half. */
EQUATION struct link_motion link_motion(const struct arm *arm, const real ddq[2]) {
    const real zero = constant(0.0);
    const struct vector omega = {zero, arm->dq[0], zero};
    const struct vector domega = {zero, ddq[0], zero};
    const struct vector r_1_c1 = {zero, zero, arm->lc1};
    const struct vector r_1_2 = {arm->a, zero, arm->l1};
    const struct vector r_2_c2 = {zero, zero, arm->q[1]};
    const struct vector slide_velocity = {zero, zero, arm->dq[1]};
    const struct vector slide_acceleration = {zero, zero, ddq[1]};

    const struct vector ac1 = rigid_acceleration(omega, domega, r_1_c1);
    const struct vector ae1 = rigid_acceleration(omega, domega, r_1_2);
    const struct vector relative = vector_plus(
        vector_plus(ae1, rigid_acceleration(omega, domega, r_2_c2)), slide_acceleration);
    const struct vector coriolis =
        vector_scaled(constant(2.0), vector_cross(omega, slide_velocity));
    return (struct link_motion){omega, domega, ac1, ae1, vector_plus(relative, coriolis)};
}

/* ---- Backward ------------------------------------------------------------------------------- */

/* -g y0 */
EQUATION struct vector gravity_acceleration(const struct arm *arm) {
    const real along_y0 = negative(arm->g);
    return (struct vector){times(along_y0, arm->c1), constant(0.0), times(along_y0, arm->s1)};
}

/* (19):  f2 = m2 (ac2 - g),  (20):  tau2 = I2 omega' - f2 x r_2_c2
 *
 * omega x I omega vanishes because omega lies along y. */
EQUATION void link2_loads(const struct arm *arm, const struct link_motion *motion,
                          struct joint_loads *loads) {
    const real zero = constant(0.0);
    const struct vector r_2_c2 = {zero, zero, arm->q[1]};

    loads->f2 = vector_scaled(arm->m2, vector_minus(motion->ac2, gravity_acceleration(arm)));
    const struct vector moment = vector_cross(loads->f2, r_2_c2);
    loads->tau2 = vector_minus(vector_scaled(arm->I2z, motion->domega), moment);
}

/* (21):  f1 = f2 + m1 (ac1 - g),  (22):  tau1 = tau2 - f1 x r_1_c1 + f2 x r_2_c1 + I1 omega' */
EQUATION void link1_loads(const struct arm *arm, const struct link_motion *motion,
                          struct joint_loads *loads) {
    const real zero = constant(0.0);
    const struct vector r_1_c1 = {zero, zero, arm->lc1};
    const struct vector r_2_c1 = {negative(arm->a), zero, minus(arm->lc1, arm->l1)};

    const struct vector inertial = vector_minus(motion->ac1, gravity_acceleration(arm));
    loads->f1 = vector_plus(loads->f2, vector_scaled(arm->m1, inertial));
    const struct vector moment1 = vector_cross(loads->f1, r_1_c1);
    const struct vector moment2 = vector_cross(loads->f2, r_2_c1);
    const struct vector moments = vector_plus(vector_minus(loads->tau2, moment1), moment2);
    loads->tau1 = vector_plus(moments, vector_scaled(arm->I1z, motion->domega));
}

#endif
