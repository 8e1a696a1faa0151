/* A body fixed to link 2, in any arithmetic (equation.h). */
#ifndef RP_PAYLOAD_LIFTED_H
#define RP_PAYLOAD_LIFTED_H

#include "rp_equations_lifted.h"

struct payload {
    real mass;    /* kg */
    real inertia; /* kg.m2: about its center of mass, along z0 */
    real x;       /* m: its center of mass in frame 2, along x2 */
    real z;       /* m: the same, along z2 (the slide) */
};

/* Link 2 and the payload are one rigid body. With M = m2 + mp its center of mass is at
 * mp (cx, cz) / M in frame 2, and its inertia about that follows from the parallel axes:
 *
 *   m2 -> M,  a -> a + mp cx / M,  l1 -> l1 + mp cz / M,
 *   I2z -> I2z + Ip + (m2 mp / M) (cx^2 + cz^2)
 *
 * in dynamics and energies. offset (m): the center of mass of both, from that of link 2. */
EQUATION void arm_attach(struct arm *arm, const struct payload *payload, real offset[2]) {
    const real mass = plus(arm->m2, payload->mass);
    const real share = quotient(payload->mass, mass);
    const real distance2 = plus(times(payload->x, payload->x), times(payload->z, payload->z));
    offset[0] = times(share, payload->x);
    offset[1] = times(share, payload->z);

    const real parallel = times(times(arm->m2, share), distance2);
    arm->I2z = plus(plus(arm->I2z, payload->inertia), parallel);
    arm->m2 = mass;
    arm->a = plus(arm->a, offset[0]);
    arm->l1 = plus(arm->l1, offset[1]);
    arm->L = plus(arm->l1, arm->q[1]);
    const real link1 = times(times(arm->m1, arm->lc1), arm->lc1);
    const real fixed = plus(plus(link1, arm->I1z), arm->I2z);
    arm->J = plus(fixed, times(times(arm->m2, arm->L), arm->L));
}

#endif
