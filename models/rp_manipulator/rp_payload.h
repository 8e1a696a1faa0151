/* A body fixed to link 2. */
#pragma once

#include "rp_equations.h"

struct payload {
    real mass;    /* kg */
    real inertia; /* kg.m2: about its center of mass, along z0 */
    real x;       /* m: its center of mass in frame 2, along x2 */
    real z;       /* m: the same, along z2 (the slide) */
};

/* Makes link 2 and the payload one rigid body, in dynamics and energies: m2, a, l1 and I2z then
 * describe both, by their common center of mass and the parallel axes through it. offset (m): from
 * the center of mass of link 2 to the common one. */
static inline void arm_attach(struct arm *arm, const struct payload *payload, real offset[2]) {
    const real mass = arm->m2 + payload->mass;
    const real share = payload->mass / mass;
    const real distance2 = payload->x * payload->x + payload->z * payload->z;
    const real parallel = arm->m2 * share * distance2;
    offset[0] = share * payload->x;
    offset[1] = share * payload->z;

    arm->I2z = arm->I2z + payload->inertia + parallel;
    arm->m2 = mass;
    arm->a += offset[0];
    arm->l1 += offset[1];
    arm->L = arm->l1 + arm->q[1];
    arm->J = arm->m1 * arm->lc1 * arm->lc1 + arm->I1z + arm->I2z + arm->m2 * arm->L * arm->L;
}
