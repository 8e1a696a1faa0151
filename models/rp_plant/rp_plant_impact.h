/* Impacts of two coupled joints at rigid stops, with restitution, and the plastic impact of an arm
 * that grasps a payload at rest.
 *
 * At a stop that a joint moves into, or rests on, the impulse P pushes the joint away from the stop
 * (positive at a lower one). With velocities counted away from the stop,
 *
 *   P_i >= 0,  q_i'+ + e_i q_i'- >= 0,  one of them is 0;   D (q'+ - q'-) = P.
 *
 * D is positive definite: one of the four patterns fits. The impact takes
 * sum of P_i (1 - e_i) |q_i'-| / 2 >= 0 of the kinetic energy, also at two stops at once. Friction
 * is bounded and has no impulse: an impact at one joint can knock a stuck other one loose. */
#pragma once

#include "rp_plant.h"

struct rp_plant_contacts {
    int side[2]; /* +1: the joint is on its lower stop, -1: on its upper one, 0: on none */
    double restitution[2]; /* 0 .. 1 */
};

struct rp_plant_impact {
    double dq[2];      /* rad/s, m/s: after the impact */
    double impulse[2]; /* N.m.s, N.s: on the joint */
    double loss;       /* J, >= 0 */
};

/* dq: before the impact. A joint that moves away from its stop has no contact. */
void rp_plant_impact(const struct rp_plant_inertia *inertia,
                     const struct rp_plant_contacts *contacts, const double dq[2],
                     struct rp_plant_impact *impact);

/* The impact that takes all velocity of some joints, whatever its direction: the same laws, with
 * impulses at these joints only, which may pull. */
void rp_plant_catch(const struct rp_plant_inertia *inertia, const bool caught[2],
                    const double dq[2], struct rp_plant_impact *impact);

/* Velocities after the arm has grasped a payload that was at rest, D+ q'+ = D- q'-, and the kinetic
 * energy that this takes, (q'-^T D- q'- - q'+^T D+ q'+) / 2 >= 0 (J). */
double rp_plant_grasp_at_rest(const struct rp_plant_parameters *p, const double q[2],
                              const double dq[2], double dq_after[2]);
