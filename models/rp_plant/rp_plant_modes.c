#include "rp_plant_modes.h"

#include "rp_plant_contact.h"
#include "rp_plant_equations.h"

#include <math.h>
#include <string.h>

/* ---- Joints at rest ------------------------------------------------------------------------- */

/* Solves D a = forces in the rows of the joints that move, with a = 0 in the others. */
static void accelerate(const struct rp_plant_inertia *inertia, const bool moves[2],
                       const double forces[2], double a[2]) {
    const double(*D)[2] = inertia->D;
    if (moves[0] && moves[1]) {
        a[0] = (D[1][1] * forces[0] - D[0][1] * forces[1]) / inertia->determinant;
        a[1] = (D[0][0] * forces[1] - D[1][0] * forces[0]) / inertia->determinant;
        return;
    }
    for (int i = 0; i < 2; i++) {
        a[i] = moves[i] ? forces[i] / D[i][i] : 0.0;
    }
}

/* Returns by how much friction and stop of a joint that stays fall short: a closed stop takes any
 * push towards it. */
static double missing_hold(double reaction, double breakaway, int closed) {
    return (closed == 0 ? fabs(reaction) : closed * reaction) - breakaway;
}

double rp_plant_rest_misfit(const struct rp_plant_rest *rest, const int pattern[2],
                            struct rp_plant_outcome *outcome) {
    const double(*D)[2] = rest->inertia.D;
    double driving[2];
    bool moves[2];
    for (int i = 0; i < 2; i++) {
        outcome->pattern[i] = pattern[i];
        moves[i] = !rest->at_rest[i] || pattern[i] != 0;
        driving[i] = rest->forces[i] - pattern[i] * rest->breakaway[i];
    }
    accelerate(&rest->inertia, moves, driving, outcome->ddq);

    double misfit = -INFINITY;
    for (int i = 0; i < 2; i++) {
        const double other = D[i][1 - i] * outcome->ddq[1 - i];
        outcome->reaction[i] = 0.0;
        if (!rest->at_rest[i]) {
            continue;
        }
        if (pattern[i] == -rest->closed[i] && pattern[i] != 0) {
            return INFINITY;
        }
        double missing;
        if (pattern[i] == 0) {
            outcome->reaction[i] = rest->forces[i] - other;
            missing = missing_hold(outcome->reaction[i], rest->breakaway[i], rest->closed[i]);
        } else {
            outcome->reaction[i] = pattern[i] * rest->breakaway[i];
            missing = -pattern[i] * D[i][i] * outcome->ddq[i];
            // a joint that leaves without an acceleration stays
            missing = missing == 0.0 ? INFINITY : missing;
        }
        const double scale = fabs(rest->forces[i]) + fabs(other) + rest->breakaway[i];
        const double relative = scale > 0.0 ? missing / scale : missing;
        misfit = relative > misfit ? relative : misfit;
    }
    return misfit;
}

void rp_plant_rest_decide(const struct rp_plant_rest *rest, struct rp_plant_outcome *outcome) {
    // staying comes first
    static const int order[3] = {0, 1, -1};
    const int count[2] = {rest->at_rest[0] ? 3 : 1, rest->at_rest[1] ? 3 : 1};
    double least = rp_plant_rest_misfit(rest, (const int[2]){0, 0}, outcome);
    for (int k = 1; k < count[0] * count[1] && !(least <= 0.0); k++) {
        struct rp_plant_outcome tried;
        const int pattern[2] = {order[k / count[1]], order[k % count[1]]};
        const double misfit = rp_plant_rest_misfit(rest, pattern, &tried);
        if (misfit < least) {
            least = misfit;
            *outcome = tried;
        }
    }
}

/* ---- Modes from velocities and forces ------------------------------------------------------- */

/* Returns the mode of a joint that moves, or begins to, in a direction. */
static int moving_mode(const struct rp_plant_parameters *p, int joint, int direction) {
    if (plant_breakaway(p, joint) > 0.0) {
        return direction > 0 ? RP_PLANT_FORWARD : RP_PLANT_BACKWARD;
    }
    return RP_PLANT_FREE;
}

bool rp_plant_find_rest(const struct rp_plant_parameters *p, const double q[2], const double dq[2],
                        struct rp_plant_modes *modes, struct rp_plant_rest *rest) {
    bool is_any = false;
    rp_plant_find_contacts(p, q, dq, modes);
    for (int i = 0; i < 2; i++) {
        rest->breakaway[i] = plant_breakaway(p, i);
        rest->closed[i] = plant_closed_stop(p, i, q[i]);
        rest->at_rest[i] = dq[i] == 0.0 && (rest->breakaway[i] > 0.0 || rest->closed[i] != 0);
        modes->joint[i] =
            rest->at_rest[i] ? RP_PLANT_STUCK : moving_mode(p, i, dq[i] > 0.0 ? 1 : -1);
        is_any |= rest->at_rest[i];
    }
    return is_any;
}

void rp_plant_decide(const struct rp_plant_parameters *p, const double q[2], const double dq[2],
                     const struct rp_plant_inputs *inputs, struct rp_plant_modes *modes,
                     struct rp_plant_decision *decision) {
    struct rp_plant_rest *rest = &decision->rest;
    const bool attached = modes->payload == RP_PLANT_ATTACHED;
    rp_plant_inertia(p, attached, q[1], &rest->inertia);
    rp_plant_forces(p, modes, q, dq, inputs, rest->forces);
    rp_plant_rest_decide(rest, &decision->outcome);
    for (int i = 0; i < 2; i++) {
        const int direction = decision->outcome.pattern[i];
        if (direction != 0) {
            modes->joint[i] = moving_mode(p, i, direction);
        }
    }
}

void rp_plant_first_modes(const struct rp_plant_values *values, const double q[2],
                          const double dq[2], const struct rp_plant_inputs *inputs,
                          struct rp_plant_modes *modes) {
    const struct rp_plant_parameters *p = &values->parameters;
    *modes = values->modes;
    modes->payload = values->payload_attached != 0 ? RP_PLANT_ATTACHED : RP_PLANT_RELEASED;
    struct rp_plant_decision decision;
    if (rp_plant_find_rest(p, q, dq, modes, &decision.rest)) {
        rp_plant_decide(p, q, dq, inputs, modes, &decision);
    }
    rp_plant_begin_contacts(p, q, dq, inputs, modes);
}

const struct rp_plant_values *rp_plant_in_effect(const struct rp_plant_values *values,
                                                 const double x[], const double u[],
                                                 struct rp_plant_values *copy) {
    struct rp_plant_modes modes;
    struct rp_plant_inputs inputs;
    if (rp_plant_modes_are_decided(values, &modes) &&
        memcmp(&modes, &values->modes, sizeof modes) == 0) {
        return values;
    }
    memcpy(&inputs, u, sizeof inputs);
    rp_plant_modes_in_effect(values, x, x + 2, &inputs, &modes);
    *copy = *values;
    copy->modes = modes;
    return copy;
}

/* ---- Held joints ----------------------------------------------------------------------------- */

static bool stays_stuck(const struct rp_plant_values *values, int joint, double most_force) {
    const struct rp_plant_parameters *p = &values->parameters;
    const double margin = 1.0 + 1e-9; // far above the rounding of the forces
    return values->modes.joint[joint] == RP_PLANT_STUCK && values->dq[joint] == 0.0 &&
           values->modes.contact[joint] == RP_PLANT_APART && !rp_plant_has_contacts(p, joint) &&
           plant_closed_stop(p, joint, values->q[joint]) == 0 &&
           margin * most_force < plant_breakaway(p, joint);
}

bool rp_plant_surely_holds(const struct rp_plant_values *values) {
    const struct arm_parameters *arm = &values->parameters.arm;
    const struct rp_plant_inputs *inputs = &values->inputs;
    if (values->modes.payload != RP_PLANT_RELEASED || values->payload_attached != 0) {
        return false;
    }
    // as if each term had the largest sine and cosine, and no two of them opposite signs
    const double L = fabs(arm->l1 + values->q[1]);
    const double a = fabs(arm->a);
    const double weight2 = fabs(arm->m2 * arm->g);
    const double weight1 = fabs(arm->m1 * arm->lc1 * arm->g) + weight2 * (L + a);
    const double push = fabs(inputs->wrench[0]) + fabs(inputs->wrench[1]);
    const double moment = push * (L + a) + fabs(inputs->wrench[2]);
    return stays_stuck(values, 0, fabs(inputs->tau[0]) + moment + weight1) &&
           stays_stuck(values, 1, fabs(inputs->tau[1]) + push + weight2);
}

/* ---- Breaking away -------------------------------------------------------------------------- */

/* Returns the side on which a joint that stays is at its limit: the side that has triggered, or
 * where the reaction is the breakaway friction. */
static int side_at_limit(const struct rp_plant_decision *decision, int joint, int leaves) {
    const struct rp_plant_rest *rest = &decision->rest;
    if (!rest->at_rest[joint] || decision->outcome.pattern[joint] != 0) {
        return 0;
    }
    if (leaves != 0) {
        return leaves;
    }
    const double reaction = decision->outcome.reaction[joint];
    if (reaction >= rest->breakaway[joint] && rest->closed[joint] >= 0) {
        return 1;
    }
    return -reaction >= rest->breakaway[joint] && rest->closed[joint] <= 0 ? -1 : 0;
}

/* Writes time derivatives of the reactions of stuck joints along the motion. */
static void reaction_rates(const struct rp_plant_values *values, const struct event *event,
                           double rates[2]) {
    struct rp_plant_values first = {.q = {values->dq[0], values->dq[1]}};
    struct rp_plant_motion now;
    rp_plant_motion(&values->parameters, &values->modes, values->q, values->dq, &values->inputs,
                    &now);
    memcpy(first.dq, now.ddq, sizeof first.dq);
    memcpy(&first.inputs, event->du, sizeof first.inputs);
    (void)rp_plant_model.derivatives(values, event->t, 1.0, &first, NULL);
    for (int i = 0; i < 2; i++) {
        rates[i] = first.friction[i] - first.stop_force[i];
    }
}

void rp_plant_break_away(struct rp_plant_values *values, const struct event *event,
                         const struct rp_plant_decision *decision, const int leaves[2]) {
    const int side[2] = {side_at_limit(decision, 0, leaves[0]),
                         side_at_limit(decision, 1, leaves[1])};
    if (side[0] == 0 && side[1] == 0) {
        return;
    }
    const struct rp_plant_parameters *p = &values->parameters;
    struct rp_plant_rest next = {.inertia = decision->rest.inertia};
    reaction_rates(values, event, next.forces);
    struct rp_plant_outcome outcome = {.reaction = {next.forces[0], next.forces[1]}};
    if (side[0] != 0 && side[1] != 0) {
        for (int i = 0; i < 2; i++) {
            next.at_rest[i] = true;
            next.closed[i] = side[i];
        }
        rp_plant_rest_decide(&next, &outcome);
    }
    for (int i = 0; i < 2; i++) {
        const double push = side[i] * outcome.reaction[i];
        if (side[i] != 0 &&
            (outcome.pattern[i] != 0 || push > 0.0 || (leaves[i] != 0 && push == 0.0))) {
            values->modes.joint[i] = moving_mode(p, i, side[i]);
        }
    }
}
