/* Which joints stick, slide or move freely: decided for both at once, from velocities and forces.
 */
#ifndef RP_PLANT_MODES_H
#define RP_PLANT_MODES_H

#include "model.h"
#include "rp_plant_contact.h"
#include "rp_plant_model.h"
#include "rp_plant_rest.h"

/* A decision about the joints at rest, and what it was made from. */
struct rp_plant_decision {
    struct rp_plant_rest rest;
    struct rp_plant_outcome outcome;
};

/* Whether a joint can stick: by dry friction or on a rigid stop. */
static inline bool rp_plant_can_stick(const struct rp_plant_parameters *p, int joint) {
    return p->coulomb_friction[joint] > 0.0 || p->breakaway_friction[joint] > 0.0 ||
           p->stops[joint] == RP_PLANT_STOPS_RIGID;
}

/* Writes the contacts, which joints are at rest, and the joints' modes as long as these stay. True:
 * one is at rest. */
bool rp_plant_find_rest(const struct rp_plant_parameters *p, const double q[2], const double dq[2],
                        struct rp_plant_modes *modes, struct rp_plant_rest *rest);

/* After rp_plant_find_rest: the accelerations, and the modes of the joints that begin to move. That
 * of the payload is given. */
void rp_plant_decide(const struct rp_plant_parameters *p, const double q[2], const double dq[2],
                     const struct rp_plant_inputs *inputs, struct rp_plant_modes *modes,
                     struct rp_plant_decision *decision);

/* Both joints stick and will do so, without a payload and apart from stops: whatever the angle is,
 * friction exceeds the forces. False: that takes a decision. */
bool rp_plant_surely_holds(const struct rp_plant_values *values);

/* At the limit with no acceleration, stuck and sliding fit both: the next derivative decides. It
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

/* Writes the modes in effect: those of the last event, or during initialization, when none has
 * been, the first ones. Inline, as each evaluation asks for them; a modified copy that is returned
 * stalls the processor, which cannot load parts together that were stored apart. */
static inline void rp_plant_modes_in_effect(const struct rp_plant_values *values, const double q[2],
                                            const double dq[2],
                                            const struct rp_plant_inputs *inputs,
                                            struct rp_plant_modes *modes) {
    *modes = values->modes;
    if (modes->payload == RP_PLANT_UNDECIDED) {
        rp_plant_first_modes(values, q, dq, inputs, modes);
        return;
    }
    for (int i = 0; i < 2; i++) {
        if (!rp_plant_has_contacts(&values->parameters, i)) {
            modes->contact[i] = RP_PLANT_APART;
        }
        if (!rp_plant_can_stick(&values->parameters, i)) {
            modes->joint[i] = RP_PLANT_FREE;
        }
    }
}

#endif
