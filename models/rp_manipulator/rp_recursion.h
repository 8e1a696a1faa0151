/* The Newton-Euler recursion of the notes, (16)-(27). It shares no equation of motion with
 * rp_equations.h, which it checks. A comment that begins with a number stands above this equation
 * of the notes. */
#pragma once

#include "rp_equations.h"

/* In the frame of a link; frames 1 and 2 are parallel. */
struct vector {
    real x, y, z;
};

/* Motion of the links. */
struct link_motion {
    struct vector omega;  /* rad/s: angular velocity, of both links */
    struct vector domega; /* rad/s2: angular acceleration, of both links */
    struct vector ac1;    /* m/s2: center of mass of link 1 */
    struct vector ae1;    /* m/s2: end of link 1 */
    struct vector ac2;    /* m/s2: center of mass of link 2 */
};

/* Force and moment that each link receives through its joint. */
struct joint_loads {
    struct vector f1;   /* N */
    struct vector tau1; /* N.m; its y drives joint 1 */
    struct vector f2;   /* N; its z drives joint 2 */
    struct vector tau2; /* N.m */
};

/* ---- Vectors -------------------------------------------------------------------------------- */

static inline struct vector vector_plus(struct vector u, struct vector v) {
    return (struct vector){u.x + v.x, u.y + v.y, u.z + v.z};
}

static inline struct vector vector_minus(struct vector u, struct vector v) {
    return (struct vector){u.x - v.x, u.y - v.y, u.z - v.z};
}

static inline struct vector vector_scaled(real factor, struct vector v) {
    return (struct vector){factor * v.x, factor * v.y, factor * v.z};
}

static inline struct vector vector_cross(struct vector u, struct vector v) {
    return (struct vector){
        .x = u.y * v.z - u.z * v.y,
        .y = u.z * v.x - u.x * v.z,
        .z = u.x * v.y - u.y * v.x,
    };
}

/* ---- Forward -------------------------------------------------------------------------------- */

/* omega' x r + omega x (omega x r): acceleration of a point fixed to a body whose origin does not
 * accelerate. */
static inline struct vector rigid_acceleration(struct vector omega, struct vector domega,
                                               struct vector r) {
    const struct vector centripetal = vector_cross(omega, vector_cross(omega, r));
    return vector_plus(vector_cross(domega, r), centripetal);
}

/* (16)-(18) Both links turn about y1 = y2 = z0.
 *
 * Departs from the notes in (18): as printed it has one q1' q2' i, where the Coriolis acceleration
 * 2 omega x q2' k needs two. The printed term leaves (26) short of m2 L q1' q2' against (14). */
static inline struct link_motion link_motion(const struct arm *arm, const real ddq[2]) {
    const struct vector omega = {0.0, arm->dq[0], 0.0};
    const struct vector domega = {0.0, ddq[0], 0.0};
    const struct vector r_1_c1 = {0.0, 0.0, arm->lc1};
    const struct vector r_1_2 = {arm->a, 0.0, arm->l1};
    const struct vector r_2_c2 = {0.0, 0.0, arm->q[1]};
    const struct vector slide_velocity = {0.0, 0.0, arm->dq[1]};
    const struct vector slide_acceleration = {0.0, 0.0, ddq[1]};

    const struct vector ac1 = rigid_acceleration(omega, domega, r_1_c1);
    const struct vector ae1 = rigid_acceleration(omega, domega, r_1_2);
    const struct vector relative = vector_plus(
        vector_plus(ae1, rigid_acceleration(omega, domega, r_2_c2)), slide_acceleration);
    const struct vector coriolis = vector_scaled(2.0, vector_cross(omega, slide_velocity));
    return (struct link_motion){omega, domega, ac1, ae1, vector_plus(relative, coriolis)};
}

/* ---- Backward ------------------------------------------------------------------------------- */

/* -g y0 */
static inline struct vector gravity_acceleration(const struct arm *arm) {
    const real along_y0 = -arm->g;
    return (struct vector){along_y0 * arm->c1, 0.0, along_y0 * arm->s1};
}

/* (19), (20), (24), (25) Loads of joint 2. omega x I omega vanishes because omega lies along y. */
static inline void link2_loads(const struct arm *arm, const struct link_motion *motion,
                               struct joint_loads *loads) {
    const struct vector r_2_c2 = {0.0, 0.0, arm->q[1]};

    loads->f2 = vector_scaled(arm->m2, vector_minus(motion->ac2, gravity_acceleration(arm)));
    const struct vector moment = vector_cross(loads->f2, r_2_c2);
    loads->tau2 = vector_minus(vector_scaled(arm->I2z, motion->domega), moment);
}

/* (21)-(23) Loads of joint 1. */
static inline void link1_loads(const struct arm *arm, const struct link_motion *motion,
                               struct joint_loads *loads) {
    const struct vector r_1_c1 = {0.0, 0.0, arm->lc1};
    const struct vector r_2_c1 = {-arm->a, 0.0, arm->lc1 - arm->l1};

    const struct vector inertial = vector_minus(motion->ac1, gravity_acceleration(arm));
    loads->f1 = vector_plus(loads->f2, vector_scaled(arm->m1, inertial));
    const struct vector moment1 = vector_cross(loads->f1, r_1_c1);
    const struct vector moment2 = vector_cross(loads->f2, r_2_c1);
    const struct vector moments = vector_plus(vector_minus(loads->tau2, moment1), moment2);
    loads->tau1 = vector_plus(moments, vector_scaled(arm->I1z, motion->domega));
}

/* (26), (27) What drives the joints are the efforts, along every curve of motions. These components
 * take their derivatives from there: what would cancel between the terms of (22) and (25) does not
 * arise. */
static inline struct joint_loads loads_of_motion(const struct arm *arm, const real tau[2],
                                                 const real ddq[2]) {
    const struct link_motion motion = link_motion(arm, ddq);
    struct joint_loads loads;
    link2_loads(arm, &motion, &loads);
    loads.f2.z = moving_as(loads.f2.z, tau[1]);
    link1_loads(arm, &motion, &loads);
    loads.tau1.y = moving_as(loads.tau1.y, tau[0]);
    return loads;
}
