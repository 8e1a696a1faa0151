#include "rp_plant_contact.h"
#include "rp_plant_equations.h"
#include "rp_plant_impact.h"
#include "rp_plant_model.h"
#include "rp_plant_modes.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SLIP_FORWARD, SLIP_BACKWARD, LOWER, UPPER, PUSH }; /* the indicators of a joint */

/* What has triggered, by the modes until now. */
struct triggered {
    bool halted[2]; /* a sliding joint has come to rest */
    int leaves[2];  /* the direction in which a stuck joint breaks away, else 0 */
    int hit[2];     /* +1: the lower stop is reached or left, -1: the upper one, else 0 */
    bool turned[2]; /* the compliant stop begins or ends to push */
};

/* ---- Stops ---------------------------------------------------------------------------------- */

/* Puts joints that have reached a stop, or are past a rigid one, on it; side: of the rigid ones.
 * Where q is farther from the limit than rp_plant_near, the limit has been moved since.
 * True if a joint is on one of these. */
static bool place_on_stops(struct rp_plant_values *values, const struct triggered *triggered,
                           int side[2]) {
    const struct rp_plant_parameters *p = &values->parameters;
    bool is_any = false;
    for (int i = 0; i < 2; i++) {
        const double hit = triggered->hit[i] > 0 ? p->lower[i] : p->upper[i];
        const bool is_near =
            triggered->hit[i] != 0 && fabs(values->q[i] - hit) <= rp_plant_near(hit);
        side[i] = plant_closed_stop(p, i, values->q[i]);
        if (side[i] == 0 && is_near && p->stops[i] == RP_PLANT_STOPS_RIGID) {
            side[i] = triggered->hit[i];
        }
        if (is_near && rp_plant_has_contacts(p, i)) {
            values->q[i] = hit;
        }
        if (side[i] != 0) {
            values->q[i] = side[i] > 0 ? p->lower[i] : p->upper[i];
            is_any = true;
        }
    }
    return is_any;
}

/* What follows from the state. */
struct found {
    struct rp_plant_modes modes;
    struct rp_plant_decision decision;
    bool rests;    /* true if a joint is at rest */
    bool is_valid; /* false if the state has changed since */
};

/* Finds what follows from the state, unless it is known; is_forced: with no joint at rest, too. */
static void find(const struct rp_plant_values *values, bool is_forced, struct rp_plant_modes *modes,
                 struct found *found) {
    const struct rp_plant_parameters *p = &values->parameters;
    if (found->is_valid) {
        *modes = found->modes;
        return;
    }
    found->rests = rp_plant_find_rest(p, values->q, values->dq, modes, &found->decision.rest);
    if (found->rests || is_forced) {
        rp_plant_decide(p, values->q, values->dq, &values->inputs, modes, &found->decision);
    }
}

/* True if a joint on a stop leaves it and comes back from no more than the tolerance of q: at v^2 /
 * (2 |q''|), where q'' points into the stop. */
static bool hardly_leaves(const struct rp_plant_values *values, const struct event *event,
                          int joint, int side, struct found *found) {
    const double dq = values->dq[joint];
    if (!(side * dq > 0.0)) {
        return false;
    }
    struct rp_plant_modes modes = values->modes;
    find(values, true, &modes, found);
    found->modes = modes;
    found->is_valid = true;
    const double into = -side * found->decision.outcome.ddq[joint];
    return into > 0.0 && dq * dq <= 2.0 * into * fmax(event->rest, 1.0) * event->tolerance[joint];
}

static bool moves_into_stop(const struct rp_plant_values *values, const int side[2]) {
    return side[0] * values->dq[0] < 0.0 || side[1] * values->dq[1] < 0.0;
}

static struct rp_plant_inertia inertia_of(const struct rp_plant_values *values) {
    struct rp_plant_inertia inertia;
    const bool attached = values->modes.payload == RP_PLANT_ATTACHED;
    rp_plant_inertia(&values->parameters, attached, values->q[1], &inertia);
    return inertia;
}

static void apply_impact(struct rp_plant_values *values, const struct rp_plant_impact *impact) {
    for (int i = 0; i < 2; i++) {
        values->dq[i] = impact->dq[i];
        values->sums.stop_impulse[i] += impact->impulse[i];
    }
    values->sums.impact_loss += impact->loss;
}

/* Ends bouncing: a joint that hardly leaves its stop stays, whether it bounces or another
 * joint's impact kicks it. One that rests on its own stop stays with it; otherwise each would kick
 * the other, for ever. True if velocities jump. */
static bool catch_on_stops(struct rp_plant_values *values, const struct event *event,
                           const int side[2], struct found *found) {
    bool leaves = false;
    bool caught[2];
    for (int i = 0; i < 2; i++) {
        const bool hardly = hardly_leaves(values, event, i, side[i], found);
        caught[i] = hardly || (side[i] != 0 && values->dq[i] == 0.0);
        leaves = leaves || hardly;
    }
    if (leaves) {
        const struct rp_plant_inertia inertia = inertia_of(values);
        struct rp_plant_impact impact;
        rp_plant_catch(&inertia, caught, values->dq, &impact);
        apply_impact(values, &impact);
        found->is_valid = false;
    }
    return leaves;
}

/* Applies impacts until no joint moves into its stop; true if velocities jump. With both joints on
 * stops, an impact of one can drive the other, which was leaving, back into its stop: that is the
 * next impact, at the same time. There may be many before both leave or stay; from some number on
 * they are plastic, and one or two more end them. */
static bool apply_impacts(struct rp_plant_values *values, const struct event *event,
                          const int side[2], struct found *found) {
    enum { MOST_ELASTIC = 8, MOST = 16 };
    const struct rp_plant_parameters *p = &values->parameters;
    bool jumps = catch_on_stops(values, event, side, found);
    for (int count = 0; count < MOST && moves_into_stop(values, side); count++) {
        const bool elastic = count < MOST_ELASTIC;
        const struct rp_plant_contacts contacts = {
            .side = {side[0], side[1]},
            .restitution = {elastic ? p->restitution[0] : 0.0, elastic ? p->restitution[1] : 0.0},
        };
        const struct rp_plant_inertia inertia = inertia_of(values);
        struct rp_plant_impact impact;
        rp_plant_impact(&inertia, &contacts, values->dq, &impact);
        apply_impact(values, &impact);
        found->is_valid = false;
        (void)catch_on_stops(values, event, side, found);
        jumps = true;
    }
    return jumps;
}

/* ---- Payload -------------------------------------------------------------------------------- */

/* Grasps or releases the payload; true if the inertia changes. Before the first event nothing is
 * grasped: a payload that is attached then belongs to link 2. */
static bool take_payload(struct rp_plant_values *values) {
    const struct rp_plant_parameters *p = &values->parameters;
    const int mode = values->payload_attached != 0 ? RP_PLANT_ATTACHED : RP_PLANT_RELEASED;
    const int before = values->modes.payload;
    values->modes.payload = mode;
    if (before == mode || before == RP_PLANT_UNDECIDED) {
        return false;
    }
    if (mode == RP_PLANT_ATTACHED && p->grasp == RP_PLANT_GRASP_AT_REST) {
        double dq[2];
        values->sums.grasp_loss += rp_plant_grasp_at_rest(p, values->q, values->dq, dq);
        memcpy(values->dq, dq, sizeof dq);
    }
    return true;
}

/* ---- struct model_events -------------------------------------------------------------------- */

static void read_triggered(const struct rp_plant_values *values, const bool *at_zero,
                           struct triggered *triggered) {
    *triggered = (struct triggered){.halted = {false}};
    if (at_zero == NULL || values->modes.payload == RP_PLANT_UNDECIDED) {
        return;
    }
    for (int i = 0; i < 2; i++) {
        bool of_joint[PLANT_INDICATORS];
        for (int k = 0; k < PLANT_INDICATORS; k++) {
            of_joint[k] = at_zero[plant_indicator_index(i, k)];
        }
        const int mode = values->modes.joint[i];
        triggered->halted[i] = plant_slides(mode) && of_joint[SLIP_FORWARD];
        if (mode == RP_PLANT_STUCK && of_joint[SLIP_FORWARD] != of_joint[SLIP_BACKWARD]) {
            triggered->leaves[i] = of_joint[SLIP_FORWARD] ? 1 : -1;
        }
        if (mode != RP_PLANT_STUCK && of_joint[LOWER] != of_joint[UPPER]) {
            triggered->hit[i] = of_joint[LOWER] ? 1 : -1;
        }
        triggered->turned[i] = of_joint[PUSH] && values->modes.contact[i] != RP_PLANT_APART;
    }
}

/* True if all modes are of their enumerations. */
static bool modes_exist(const struct rp_plant_modes *modes) {
    const int *joint = modes->joint;
    const int *contact = modes->contact;
    return joint[0] >= RP_PLANT_BACKWARD && joint[0] <= RP_PLANT_FREE &&
           joint[1] >= RP_PLANT_BACKWARD && joint[1] <= RP_PLANT_FREE &&
           modes->payload >= RP_PLANT_UNDECIDED && modes->payload <= RP_PLANT_RELEASED &&
           contact[0] >= -RP_PLANT_LET_GO && contact[0] <= RP_PLANT_LET_GO &&
           contact[1] >= -RP_PLANT_LET_GO && contact[1] <= RP_PLANT_LET_GO;
}

/* A joint with friction slides and one without is free, unless it sticks: then it is at rest, with
 * friction or on a stop. Contacts follow from the state. */
static bool fits(const struct rp_plant_values *values, int joint) {
    const struct rp_plant_parameters *p = &values->parameters;
    const bool has_friction = plant_breakaway(p, joint) > 0.0;
    const int mode = values->modes.joint[joint];
    if (!rp_plant_contact_fits(p, joint, values->q[joint], values->dq[joint],
                               values->modes.contact[joint])) {
        return false;
    }
    if (mode == RP_PLANT_STUCK) {
        return values->dq[joint] == 0.0 &&
               (has_friction || plant_closed_stop(p, joint, values->q[joint]) != 0);
    }
    return plant_slides(mode) == has_friction;
}

static bool modes_are_possible(const void *values_pointer, bool is_held) {
    const struct rp_plant_values *values = values_pointer;
    return modes_exist(&values->modes) && values->modes.payload != RP_PLANT_UNDECIDED &&
           (!is_held || (fits(values, 0) && fits(values, 1)));
}

/* True if no mode changes because the joints, without stops, move as they did, or stay held. */
static bool moves_on(const void *values_pointer) {
    const struct rp_plant_values *values = values_pointer;
    const struct rp_plant_parameters *p = &values->parameters;
    const struct rp_plant_modes *modes = &values->modes;
    bool is_same =
        modes->payload == (values->payload_attached != 0 ? RP_PLANT_ATTACHED : RP_PLANT_RELEASED);
    for (int i = 0; i < 2 && is_same; i++) {
        is_same = p->stops[i] == RP_PLANT_STOPS_NONE && modes->contact[i] == RP_PLANT_APART &&
                  values->dq[i] * modes->joint[i] > 0.0 && plant_breakaway(p, i) > 0.0 &&
                  plant_slides(modes->joint[i]);
    }
    return is_same || rp_plant_surely_holds(values);
}

static enum status update(void *values_pointer, const struct event *event) {
    static const int none[2] = {0, 0};
    struct rp_plant_values *values = values_pointer;
    struct triggered triggered;
    read_triggered(values, event->triggered, &triggered);

    bool jumps = false;
    for (int i = 0; i < 2; i++) {
        if (triggered.halted[i]) {
            values->dq[i] = 0.0;
            jumps = true;
        }
        if (triggered.turned[i]) {
            rp_plant_turn_contact(&values->parameters, i, &values->dq[i],
                                  &values->modes.contact[i]);
        }
    }
    if (take_payload(values)) {
        jumps = true;
    }
    int side[2];
    struct found found;
    found.is_valid = false;
    if (place_on_stops(values, &triggered, side) && apply_impacts(values, event, side, &found)) {
        jumps = true;
    }

    // what has triggered counts where the forces of the stuck joints have not changed since
    const struct rp_plant_parameters *p = &values->parameters;
    find(values, false, &values->modes, &found);
    if (found.rests) {
        rp_plant_break_away(values, event, &found.decision, jumps ? none : triggered.leaves);
    }
    rp_plant_begin_contacts(p, values->q, values->dq, &values->inputs, &values->modes);
    return STATUS_OK;
}

/* A limit that is moved past a joint while it runs takes the joint along; a start outside is a
 * mistake. */
bool rp_plant_check(const struct rp_plant_values *values, char *text, size_t size) {
    const struct rp_plant_parameters *p = &values->parameters;
    for (int i = 0; i < 2 && values->modes.payload == RP_PLANT_UNDECIDED; i++) {
        const double q = values->q[i];
        if (p->stops[i] == RP_PLANT_STOPS_RIGID && !(q >= p->lower[i] && q <= p->upper[i])) {
            const int joint = i + 1;
            (void)snprintf(text, size,
                           "q%d = %.17g is refused: a start must be within lower%d = %.17g and "
                           "upper%d = %.17g",
                           joint, q, joint, p->lower[i], joint, p->upper[i]);
            return false;
        }
    }
    return true;
}

/* Over steps in which the velocity changes by vs at most, the series shows the friction near rest.
 * Those of a fast joint, which show nothing of it, end before. */
static void reach(const void *values_pointer, const double x[], double reach[]) {
    const double fast = 6.0; // so many times vs, exp(-36) of the difference is left
    const struct rp_plant_values *values = values_pointer;
    const struct rp_plant_parameters *p = &values->parameters;
    for (int i = 0; i < 2; i++) {
        const bool is_sliding = plant_slides(values->modes.joint[i]);
        const double vs = p->stribeck_velocity[i];
        const double above_fast = fabs(x[2 + i]) - fast * vs;
        reach[i] = INFINITY;
        reach[2 + i] = INFINITY;
        if (is_sliding && p->breakaway_friction[i] > p->coulomb_friction[i]) {
            reach[2 + i] = above_fast > vs ? above_fast : vs;
        }
    }
}

static bool are_possible(const void *values_pointer) {
    const struct rp_plant_parameters *p =
        &((const struct rp_plant_values *)values_pointer)->parameters;
    return rp_plant_can_stick(p, 0) || rp_plant_can_stick(p, 1) || rp_plant_has_contacts(p, 0) ||
           rp_plant_has_contacts(p, 1) || p->payload_mass > 0.0 || p->payload_inertia > 0.0;
}

static bool is_at_rest(const void *values_pointer) {
    const struct rp_plant_values *values = values_pointer;
    if (values->modes.joint[0] != RP_PLANT_STUCK && values->modes.payload != RP_PLANT_UNDECIDED) {
        return false;
    }
    struct rp_plant_modes modes;
    rp_plant_modes_in_effect(values, values->q, values->dq, &values->inputs, &modes);
    return modes.joint[0] == RP_PLANT_STUCK && modes.joint[1] == RP_PLANT_STUCK;
}

/* As plant_stop_indicators. */
static void describe_stops(const struct rp_plant_values *values, int contact, int joint,
                           struct indicator *const of_joint[PLANT_INDICATORS]) {
    const struct rp_plant_parameters *p = &values->parameters;
    const size_t q = (size_t)joint;
    const double dq = values->dq[joint];
    // a contact that has just begun, or ended, rises as much as its joint moves that way
    const struct indicator over_lower = {INDICATOR_OF_STATE, q,        1.0,
                                         -p->lower[joint],   dq > 0.0, 0.0};
    const struct indicator below_lower = {INDICATOR_OF_STATE, q,        -1.0,
                                          p->lower[joint],    dq < 0.0, 0.0};
    const struct indicator below_upper = {INDICATOR_OF_STATE, q,        -1.0,
                                          p->upper[joint],    dq < 0.0, 0.0};
    const struct indicator over_upper = {INDICATOR_OF_STATE, q,        1.0,
                                         -p->upper[joint],   dq > 0.0, 0.0};
    if (contact == RP_PLANT_APART) {
        *of_joint[LOWER] = over_lower;
        *of_joint[UPPER] = below_upper;
        return;
    }
    const int side = contact > 0 ? 1 : -1;
    *of_joint[side > 0 ? LOWER : UPPER] = side > 0 ? below_lower : over_upper;
    if (p->stop_damping[joint] > 0.0) {
        const double sign = abs(contact) == RP_PLANT_PUSHED ? 1.0 : -1.0;
        const double factor = -sign * side * p->stop_damping[joint];
        *of_joint[PUSH] = (struct indicator){INDICATOR_OF_STATE, 2 + q, factor, sign, false, 0.0};
    }
}

/* As plant_indicators. */
static void describe_joint(const struct rp_plant_values *values, const struct rp_plant_modes *modes,
                           int joint, struct indicator *const of_joint[PLANT_INDICATORS]) {
    const struct rp_plant_parameters *p = &values->parameters;
    const int mode = modes->joint[joint];
    const size_t q = (size_t)joint;
    for (int k = 0; k < PLANT_INDICATORS; k++) {
        of_joint[k]->kind = INDICATOR_UNUSED;
    }
    if (mode == RP_PLANT_STUCK) {
        const struct indicator of_force = {.kind = INDICATOR_OF_MODEL,
                                           .offset = plant_breakaway(p, joint)};
        const int closed = plant_closed_stop(p, joint, values->q[joint]);
        if (closed >= 0) {
            *of_joint[SLIP_FORWARD] = of_force;
        }
        if (closed <= 0) {
            *of_joint[SLIP_BACKWARD] = of_force;
        }
        return;
    }
    if (plant_slides(mode)) {
        *of_joint[SLIP_FORWARD] =
            (struct indicator){.kind = INDICATOR_OF_STATE, .state = 2 + q, .factor = mode};
    }
    if (p->stops[joint] == RP_PLANT_STOPS_RIGID || rp_plant_has_contacts(p, joint)) {
        describe_stops(values, modes->contact[joint], joint, of_joint);
    }
}

static void describe(const void *values_pointer, struct indicator indicators[]) {
    const struct rp_plant_values *values = values_pointer;
    struct rp_plant_modes modes;
    rp_plant_modes_in_effect(values, values->q, values->dq, &values->inputs, &modes);
    for (int i = 0; i < 2; i++) {
        struct indicator *of_joint[PLANT_INDICATORS];
        for (int k = 0; k < PLANT_INDICATORS; k++) {
            of_joint[k] = &indicators[plant_indicator_index(i, k)];
        }
        describe_joint(values, &modes, i, of_joint);
    }
}

static enum status indicators(const void *values_pointer, double t, const double x[],
                              const double u[], double z[]) {
    const struct rp_plant_values *values = values_pointer;
    const struct rp_plant_parameters *p = &values->parameters;
    struct rp_plant_inputs inputs;
    memcpy(&inputs, u, sizeof inputs);
    struct rp_plant_modes modes;
    rp_plant_modes_in_effect(values, x, x + 2, &inputs, &modes);
    struct rp_plant_motion motion = {.reaction = {0.0}};
    if (modes.joint[0] == RP_PLANT_STUCK || modes.joint[1] == RP_PLANT_STUCK) {
        rp_plant_motion(p, &modes, x, x + 2, &inputs, &motion);
    }
    for (int i = 0; i < 2; i++) {
        double of_joint[PLANT_INDICATORS];
        plant_indicators(p, &modes, i, x[i], x[2 + i], motion.reaction[i], of_joint);
        for (int k = 0; k < PLANT_INDICATORS; k++) {
            z[plant_indicator_index(i, k)] = of_joint[k];
        }
    }
    return STATUS_OK;
}

static const char *const indicator_names[RP_PLANT_INDICATORS] = {
    "slip1_forward",  "slip1_backward", "stop1_lower", "stop1_upper", "slip2_forward",
    "slip2_backward", "stop2_lower",    "stop2_upper", "stop1_push",  "stop2_push",
};

const struct model_events rp_plant_events = {
    .indicator_count = RP_PLANT_INDICATORS,
    .indicator_names = indicator_names,
    .modes = {offsetof(struct rp_plant_values, modes), sizeof(struct rp_plant_modes)},
    .discrete_states = {offsetof(struct rp_plant_values, sums), sizeof(struct rp_plant_sums)},
    .discrete_inputs = {offsetof(struct rp_plant_values, payload_attached), sizeof(int)},
    .are_possible = are_possible,
    .modes_are_possible = modes_are_possible,
    .moves_on = moves_on,
    .is_at_rest = is_at_rest,
    .describe = describe,
    .indicators = indicators,
    .reach = reach,
    .update = update,
};
