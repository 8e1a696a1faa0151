/* Which of two coupled joints that are at rest begin to move, and how fast.
 *
 * b: all generalized forces but friction of the joints at rest and stops; R: the joints at rest;
 * F: their breakaway friction. By Gauss' principle
 *
 *   q'' = argmin  a^T D a / 2 - b^T a + sum over R of F_i |a_i| ,
 *         a_i >= 0 at a closed lower stop,  a_i <= 0 at a closed upper one.
 *
 * D is positive definite, so that the function is strictly convex and has one minimum. A pattern
 * says of each joint at rest that it goes backward, stays or goes forward: of the nine, and fewer
 * at a stop, exactly one fits the optimality conditions. */
#ifndef RP_PLANT_REST_H
#define RP_PLANT_REST_H

#include "rp_plant.h"

struct rp_plant_rest {
    struct rp_plant_inertia inertia;
    double forces[2];    /* b: N.m, N */
    double breakaway[2]; /* F: N.m, N */
    bool at_rest[2];     /* the others move and have no pattern: 0 */
    int closed[2];       /* of joints at rest: +1 at the lower stop, -1 at the upper one, else 0 */
};

struct rp_plant_outcome {
    int pattern[2];     /* of joints at rest: -1, 0, 1 */
    double ddq[2];      /* rad/s2, m/s2 */
    double reaction[2]; /* N.m, N: b - D q'', of joints at rest friction - stop, else 0 */
};

/* The motion of a pattern, and by how much it misses the conditions, in parts of the forces: at
 * most 0 if it fits. Infinite for a pattern that a stop does not allow. */
double rp_plant_rest_misfit(const struct rp_plant_rest *rest, const int pattern[2],
                            struct rp_plant_outcome *outcome);

/* The pattern that fits; the one that fits best where rounding leaves none. At the limit, where
 * |reaction| = F, the joint stays. */
void rp_plant_rest_decide(const struct rp_plant_rest *rest, struct rp_plant_outcome *outcome);

#endif
