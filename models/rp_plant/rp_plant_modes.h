/* Which joints stick, slide or move freely: decided for both at once, by velocities and forces. */
#pragma once

#include "model.h"
#include "rp_plant_contact.h"
#include "rp_plant_model.h"

/* ---- Joints at rest -------------------------------------------------------------------------
 *
 * Which of two coupled joints that are at rest begin to move, and how fast.
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

/* Writes the motion of a pattern, and returns by how much it misses the conditions, in parts of the
 * forces: at most 0 if it fits, infinite if a stop does not allow it. */
double rp_plant_rest_misfit(const struct rp_plant_rest *rest, const int pattern[2],
                            struct rp_plant_outcome *outcome);

/* Writes the motion of the pattern that fits, or that fits best where rounding leaves none. At the
 * limit, where |reaction| = F, the joint stays. */
void rp_plant_rest_decide(const struct rp_plant_rest *rest, struct rp_plant_outcome *outcome);

/* ---- Modes ---------------------------------------------------------------------------------- */

/* A decision about the joints at rest, and what it was made from. */
struct rp_plant_decision {
    struct rp_plant_rest rest;
    struct rp_plant_outcome outcome;
};

/* True if a joint can stick: by dry friction or on a rigid stop. */
static inline bool rp_plant_can_stick(const struct rp_plant_parameters *p, int joint) {
    return p->coulomb_friction[joint] > 0.0 || p->breakaway_friction[joint] > 0.0 ||
           p->stops[joint] == RP_PLANT_STOPS_RIGID;
}

/* Writes the contacts, which joints are at rest, and the joints' modes as long as these stay. True
 * if one is at rest. */
bool rp_plant_find_rest(const struct rp_plant_parameters *p, const double q[2], const double dq[2],
                        struct rp_plant_modes *modes, struct rp_plant_rest *rest);

/* Writes the accelerations, and the modes of the joints that begin to move, after
 * rp_plant_find_rest. The mode of the payload is given. */
void rp_plant_decide(const struct rp_plant_parameters *p, const double q[2], const double dq[2],
                     const struct rp_plant_inputs *inputs, struct rp_plant_modes *modes,
                     struct rp_plant_decision *decision);

/* True if both joints stick and will do so, without a payload and apart from stops: whatever the
 * angle is, friction exceeds the forces. If false, a decision is needed. */
bool rp_plant_surely_holds(const struct rp_plant_values *values);

/* Decides by the next derivative at the limit with no acceleration, where stuck and sliding fit. It
 * follows the same principle: D q''' = rates of the reactions, where a joint at its limit can only
 * go to that side, and without friction, since that does not change at breakaway. A joint whose
 * indicator has triggered (leaves: 1 forward, -1 backward, otherwise 0) leaves unless the rate
 * points back; otherwise it would trigger again. */
void rp_plant_break_away(struct rp_plant_values *values, const struct event *event,
                         const struct rp_plant_decision *decision, const int leaves[2]);

/* Writes the modes that follow from parameters, states and inputs. */
void rp_plant_first_modes(const struct rp_plant_values *values, const double q[2],
                          const double dq[2], const struct rp_plant_inputs *inputs,
                          struct rp_plant_modes *modes);

/* Corrects decided modes for parameters that have changed since. */
static inline void rp_plant_correct_modes(const struct rp_plant_parameters *p,
                                          struct rp_plant_modes *modes) {
    for (int i = 0; i < 2; i++) {
        if (!rp_plant_has_contacts(p, i)) {
            modes->contact[i] = RP_PLANT_APART;
        }
        if (!rp_plant_can_stick(p, i)) {
            modes->joint[i] = RP_PLANT_FREE;
        }
    }
}

/* Writes the modes of the last event. Returns false during initialization, when none has been: then
 * the first ones are in effect. Inline, as each evaluation asks for them; a modified copy that is
 * returned stalls the processor, which cannot load parts together that were stored apart. */
static inline bool rp_plant_modes_are_decided(const struct rp_plant_values *values,
                                              struct rp_plant_modes *modes) {
    *modes = values->modes;
    rp_plant_correct_modes(&values->parameters, modes);
    return modes->payload != RP_PLANT_UNDECIDED;
}

/* Writes the modes in effect. */
static inline void rp_plant_modes_in_effect(const struct rp_plant_values *values, const double q[2],
                                            const double dq[2],
                                            const struct rp_plant_inputs *inputs,
                                            struct rp_plant_modes *modes) {
    if (!rp_plant_modes_are_decided(values, modes)) {
        rp_plant_first_modes(values, q, dq, inputs, modes);
    }
}
