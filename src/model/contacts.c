#include "contacts.h"
#include "relations_modes.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static const double rounding = 16.0 * DBL_EPSILON; // of a velocity at rest, over its terms
static const double part_of_slack = 1e-3;          // of a velocity's tolerance, likewise
static const double drift = 1e-10;                 // of one that is held, between events

/* Arguments of all functions here, and what has been found. */
struct work {
    const struct call *call;
    const struct contacts *model;
    const struct event *event; // or NULL
    struct contacts_measured now;
    double *hold, *acceleration, *before; // per direction
    int *friction;                        // that may hold it, or -1
    int *sense;                           // of a closed stop's force; 0 if there is none
    int *stop;                            // contact that is closed
    int *rests;                           // 1 if the velocity is 0
    int *pattern;                         // sign in which a direction at rest begins to move
    int *leaves;                          // sense in which one has triggered that it leaves
    int *hit;                             // per contact: stop that has triggered; or 1: has halted
    int *struck;                          // per contact: 1 if it had an impact at this instant
    int *modes;                           // per contact, before
    bool jumps;
    bool is_decided; // since values were measured
    bool fits;       // as decided
};

static struct contacts_measured measured_in(const struct contacts *model, double *room) {
    const int directions = model->direction_count, contacts = model->contact_count;
    double *of_contacts = room + 6 * directions;
    double *others = of_contacts + 13 * contacts;
    return (struct contacts_measured){
        .velocity = room,
        .size = room + directions,
        .rest = room + 2 * directions,
        .factor = room + 3 * directions,
        .acceleration = room + 4 * directions,
        .slack = room + 5 * directions,
        .active = of_contacts,
        .ratio = of_contacts + contacts,
        .law = of_contacts + 2 * contacts,
        .coulomb = of_contacts + 3 * contacts,
        .breakaway = of_contacts + 4 * contacts,
        .stribeck = of_contacts + 5 * contacts,
        .position = of_contacts + 6 * contacts,
        .lower = of_contacts + 7 * contacts,
        .upper = of_contacts + 8 * contacts,
        .at_lower = of_contacts + 9 * contacts,
        .at_upper = of_contacts + 10 * contacts,
        .restitution = of_contacts + 11 * contacts,
        .tolerance = of_contacts + 12 * contacts,
        .response = others,
        .jump = others + directions * contacts,
    };
}

static void measure(struct work *work) {
    work->is_decided = false;
    const struct call *call = work->call;
    const double *tolerance = work->event != NULL ? work->event->tolerance : call->room.zeros;
    work->model->measure(call->values, call->t, tolerance, &work->now);
}

static double *states_of(const struct work *work) {
    return (double *)(void *)((char *)work->call->values + work->call->model->states);
}

/* Sets a state, from then on without an error. */
static void set_state(struct work *work, size_t i, double value) {
    states_of(work)[i] = value;
    work->call->room.tolerance[i] = 0.0;
    work->jumps = true;
}

static int *mode_of(const struct work *work, int contact) {
    const struct call *call = work->call;
    return &call->segments[call->model->segment_count + work->model->contact[contact].count];
}

static double *double_at(const struct work *work, size_t offset) {
    return (double *)(void *)((char *)work->call->values + offset);
}

static int sign_of(double x) {
    return (x > 0.0) - (x < 0.0);
}

/* Returns the sense in which closed stops push. */
static int sense_of(const struct work *work, int contact, int mode) {
    return (mode == STOPS_LOWER ? 1 : -1) * sign_of(work->now.ratio[contact]);
}

/* Finds the frictions that may hold directions: first ones of their contacts. */
static void find_frictions(const struct work *work) {
    for (int k = 0; k < work->model->direction_count; k++) {
        work->friction[k] = -1;
    }
    for (int e = 0; e < work->model->contact_count; e++) {
        const struct contact *contact = &work->model->contact[e];
        if (contact->is_friction && work->now.active[e] != 0.0) {
            work->friction[contact->direction] = e;
        }
    }
}

/* Returns the response of a direction's acceleration to the force that holds another one. */
static double response(const struct work *work, int to, int of) {
    const int friction = work->friction[of];
    const int contact = friction >= 0 ? friction : work->stop[of];
    const double own = work->now.response[to * work->model->contact_count + contact];
    return friction >= 0 ? -own : own / work->now.ratio[contact];
}

/* ---- Checks --------------------------------------------------------------------------------- */

/* Refuses a value; limit: of what `wanted` ends with, or NULL. */
static enum status refuse(const struct work *work, const char *name, const char *what, double value,
                          const char *wanted, const double *limit) {
    if (work->event != NULL && work->event->reason != NULL) {
        char more[40] = "";
        if (limit != NULL) {
            (void)snprintf(more, sizeof more, " = %.9g", *limit);
        }
        (void)snprintf(work->event->reason, work->event->reason_size,
                       "%s: %s = %.9g is refused: %s%s", name, what, value, wanted, more);
    }
    return STATUS_INVALID_PARAMETERS;
}

static enum status check_friction(const struct work *work, int e) {
    const struct contacts_measured *now = &work->now;
    const char *name = work->model->contact[e].name;
    if (!(now->coulomb[e] >= 0.0)) {
        return refuse(work, name, "coulomb", now->coulomb[e], "it must be 0 or more", NULL);
    }
    if (!(now->breakaway[e] >= now->coulomb[e])) {
        return refuse(work, name, "breakaway", now->breakaway[e], "it must not be below coulomb",
                      &now->coulomb[e]);
    }
    if (now->breakaway[e] > now->coulomb[e] && !(now->stribeck[e] > 0.0)) {
        return refuse(work, name, "stribeck", now->stribeck[e],
                      "it must be above 0 where breakaway is above coulomb", &now->coulomb[e]);
    }
    return STATUS_OK;
}

static enum status check_stops(const struct work *work, int e, bool is_start) {
    const struct contacts_measured *now = &work->now;
    const struct contact *contact = &work->model->contact[e];
    if (!(now->restitution[e] >= 0.0 && now->restitution[e] <= 1.0)) {
        return refuse(work, contact->name, "restitution", now->restitution[e],
                      "it must be from 0 to 1", NULL);
    }
    if (contact->has_lower && contact->has_upper && !(now->lower[e] < now->upper[e])) {
        return refuse(work, contact->name, "lower", now->lower[e], "it must be below upper",
                      &now->upper[e]);
    }
    if (is_start && contact->has_lower && now->position[e] < now->lower[e]) {
        return refuse(work, contact->name, "position", now->position[e],
                      "a start must not be below lower", &now->lower[e]);
    }
    if (is_start && contact->has_upper && now->position[e] > now->upper[e]) {
        return refuse(work, contact->name, "position", now->position[e],
                      "a start must not be above upper", &now->upper[e]);
    }
    return STATUS_OK;
}

/* Checks that the force of friction slows its velocity down, and that of stops speeds it up. */
static enum status check_response(const struct work *work, int e) {
    const struct contact *contact = &work->model->contact[e];
    const double own = work->now.ratio[e] *
                       work->now.response[contact->direction * work->model->contact_count + e];
    if (contact->is_friction ? own < 0.0 : own > 0.0) {
        return STATUS_OK;
    }
    return refuse(work, contact->name, "der(velocity) by force", own,
                  contact->is_friction ? "friction acts against its velocity, so below 0"
                                       : "the force of stops acts along their velocity, so above 0",
                  NULL);
}

static enum status check(const struct work *work, bool is_start) {
    enum status status = STATUS_OK;
    for (int e = 0; e < work->model->contact_count && status == STATUS_OK; e++) {
        if (work->now.active[e] != 0.0) {
            status = work->model->contact[e].is_friction ? check_friction(work, e)
                                                         : check_stops(work, e, is_start);
            status = status == STATUS_OK ? check_response(work, e) : status;
        }
    }
    return status;
}

/* ---- What has triggered ---------------------------------------------------------------------- */

static void read_triggered(struct work *work) {
    const bool *triggered = work->event != NULL ? work->event->triggered : NULL;
    memset(work->leaves, 0, (size_t)work->model->direction_count * sizeof *work->leaves);
    memset(work->hit, 0, (size_t)work->model->contact_count * sizeof *work->hit);
    for (int e = 0; e < work->model->contact_count && triggered != NULL; e++) {
        const struct contact *contact = &work->model->contact[e];
        const bool *own = &triggered[work->model->indicator + 2 * (size_t)e];
        const int mode = *mode_of(work, e);
        if (own[0] == own[1]) {
            continue;
        }
        if (contact->is_friction && mode == FRICTION_STUCK) {
            work->leaves[contact->direction] = own[0] ? 1 : -1;
        } else if (contact->is_friction) {
            work->hit[e] = 1;
        } else if (mode != STOPS_FREE) {
            work->leaves[contact->direction] = sense_of(work, e, mode);
        } else {
            work->hit[e] = own[0] ? STOPS_LOWER : STOPS_UPPER;
        }
    }
}

/* ---- Rest and stops -------------------------------------------------------------------------- */

/* Returns up to which speed a velocity counts as 0, which has been one of several that are. */
static double least_velocity(const struct work *work, int k) {
    const double least = fmax(rounding * work->now.size[k], part_of_slack * work->now.slack[k]);
    return work->model->direction[k].is_plain ? 0.0 : least;
}

/* Finds which velocities are 0 now, of directions that something may hold. */
static void find_rest_now(struct work *work) {
    for (int k = 0; k < work->model->direction_count; k++) {
        const bool may_rest = work->friction[k] >= 0 || work->sense[k] != 0;
        work->rests[k] = may_rest && fabs(work->now.velocity[k]) <= least_velocity(work, k);
    }
}

static bool is_held(const struct work *work, int direction) {
    bool found = false;
    for (int e = 0; e < work->model->contact_count; e++) {
        const struct contact *contact = &work->model->contact[e];
        const int free = contact->is_friction ? FRICTION_STUCK : STOPS_FREE;
        found |=
            contact->direction == direction && (*mode_of(work, e) == free) == contact->is_friction;
    }
    return found;
}

/* Returns the stop on which a contact is, or past which. Where the position is farther from the
 * limit than its tolerance, the limit has been moved since. */
static int stop_at(const struct work *work, int e) {
    const struct contacts_measured *now = &work->now;
    const struct contact *contact = &work->model->contact[e];
    const int known = work->hit[e] != 0 ? work->hit[e] : *mode_of(work, e);
    if (now->active[e] == 0.0) {
        return STOPS_FREE;
    }
    const double above = contact->has_lower ? now->position[e] - now->lower[e] : INFINITY;
    const double below = contact->has_upper ? now->upper[e] - now->position[e] : INFINITY;
    const double near = 2.0 * now->tolerance[e] + rounding * fabs(now->position[e]);
    if (above <= (known == STOPS_LOWER ? near : 0.0)) {
        return STOPS_LOWER;
    }
    return below <= (known == STOPS_UPPER ? near : 0.0) ? STOPS_UPPER : STOPS_FREE;
}

/* Puts what has reached a stop on it. */
static void place_on_stops(struct work *work) {
    memset(work->sense, 0, (size_t)work->model->direction_count * sizeof *work->sense);
    for (int e = 0; e < work->model->contact_count; e++) {
        const struct contact *contact = &work->model->contact[e];
        const int stop = contact->is_friction ? STOPS_FREE : stop_at(work, e);
        if (stop == STOPS_FREE) {
            continue;
        }
        const double at = stop == STOPS_LOWER ? work->now.at_lower[e] : work->now.at_upper[e];
        const double limit = stop == STOPS_LOWER ? work->now.lower[e] : work->now.upper[e];
        const bool is_off = work->model->direction[contact->direction].is_exact ||
                            fabs(work->now.position[e] - limit) > work->now.tolerance[e];
        if (is_off && states_of(work)[contact->position] != at) {
            set_state(work, contact->position, at);
            measure(work);
        }
        if (work->sense[contact->direction] == 0) {
            work->sense[contact->direction] = sense_of(work, e, stop);
            work->stop[contact->direction] = e;
        }
    }
}

/* ---- Forces that hold ------------------------------------------------------------------------ */

/* Adds what a force in the sense of a direction does to all accelerations. */
static void add_response(const struct work *work, int of, double force, double acceleration[]) {
    for (int k = 0; k < work->model->direction_count; k++) {
        acceleration[k] += response(work, k, of) * force;
    }
}

/* Writes accelerations without what holds directions at rest. */
static void accelerate(const struct work *work, double acceleration[]) {
    const int contacts = work->model->contact_count;
    for (int k = 0; k < work->model->direction_count; k++) {
        acceleration[k] = work->now.acceleration[k];
    }
    for (int e = 0; e < contacts; e++) {
        const struct contact *contact = &work->model->contact[e];
        const int of = contact->direction;
        if (contact->is_friction && work->now.active[e] != 0.0 && !work->rests[of]) {
            const double force =
                work->now.velocity[of] < 0.0 ? -work->now.law[e] : work->now.law[e];
            for (int k = 0; k < work->model->direction_count; k++) {
                acceleration[k] += work->now.response[k * contacts + e] * force;
            }
        }
    }
}

/* Writes the members of a block; returns how many there are. */
static int members(const struct work *work, int block, const int is_member[], int member[]) {
    int count = 0;
    for (int k = 0; k < work->model->direction_count; k++) {
        if (work->model->direction[k].block == block && is_member[k]) {
            member[count++] = k;
        }
    }
    return count;
}

static void write_box(const struct work *work, const int member[], int count, const double a0[],
                      struct box *box) {
    box->count = count;
    for (int i = 0; i < count; i++) {
        box->a0[i] = a0[member[i]];
        for (int j = 0; j < count; j++) {
            box->W[i][j] = response(work, member[i], member[j]);
        }
    }
}

/* Writes which of the directions at rest begin to move, with all accelerations. Returns false if no
 * motion fits. */
static bool decide(struct work *work) {
    if (work->is_decided) {
        return work->fits;
    }
    bool fits = true;
    accelerate(work, work->acceleration);
    memset(work->pattern, 0, (size_t)work->model->direction_count * sizeof *work->pattern);
    memset(work->hold, 0, (size_t)work->model->direction_count * sizeof *work->hold);
    for (int block = 0; block < work->model->block_count; block++) {
        int member[CONTACTS_MOST_COUPLED];
        struct box box;
        struct box_solution found;
        const int count = members(work, block, work->rests, member);
        if (count == 0) {
            continue;
        }
        write_box(work, member, count, work->acceleration, &box);
        for (int i = 0; i < count; i++) {
            const int friction = work->friction[member[i]];
            const double limit = friction >= 0 ? work->now.breakaway[friction] : 0.0;
            box.low[i] = work->sense[member[i]] < 0 ? -INFINITY : -limit;
            box.high[i] = work->sense[member[i]] > 0 ? INFINITY : limit;
        }
        box_solve(&box, &found);
        fits &= found.misfit <= 1e-6;
        for (int i = 0; i < count; i++) {
            work->pattern[member[i]] = found.leaves[i];
            work->hold[member[i]] = found.T[i];
            add_response(work, member[i], found.T[i], work->acceleration);
        }
        for (int i = 0; i < count; i++) {
            work->acceleration[member[i]] = found.a[i];
        }
    }
    work->is_decided = true;
    work->fits = fits;
    return fits;
}

/* ---- Impulses -------------------------------------------------------------------------------- */

/* Changes the states by an impulse of a contact. */
static void push(struct work *work, int contact, double impulse) {
    const double *x = states_of(work);
    const int contacts = work->model->contact_count;
    for (int i = 0; i < work->model->moved_count; i++) {
        const size_t state = work->model->moved[i];
        set_state(work, state, x[state] + work->now.jump[i * contacts + contact] * impulse);
    }
}

/* Applies impulses at stops, P per direction in its sense; the velocities before are in
 * work->before. Velocities that become 0 do so to the last bit. */
static void apply_impulses(struct work *work, const double P[], const int is_struck[],
                           const double restitution[]) {
    for (int k = 0; k < work->model->direction_count; k++) {
        if (!is_struck[k] || P[k] == 0.0) {
            continue;
        }
        const int e = work->stop[k];
        const struct contact *contact = &work->model->contact[e];
        const double impulse = P[k] / work->now.ratio[e];
        push(work, e, impulse);
        double *of_instant = double_at(work, contact->impulse);
        *of_instant = (work->struck[e] ? *of_instant : 0.0) + impulse;
        *double_at(work, contact->impulses) += impulse;
        *double_at(work, contact->loss) -= 0.5 * P[k] * (1.0 - restitution[k]) * work->before[k];
        work->struck[e] = 1;
    }
    measure(work);
    const int count = work->model->direction_count;
    bool are_plain = true;
    for (int k = 0; k < count; k++) {
        are_plain &= !is_struck[k] || work->model->direction[k].is_plain;
    }
    for (int pass = 0; pass < (are_plain ? 1 : count); pass++) {
        for (int k = 0; k < count; k++) {
            if (is_struck[k] && work->model->direction[k].is_exact) {
                if (!are_plain) {
                    measure(work); // others may have moved where this one rests
                }
                const double velocity = 0.0 - restitution[k] * work->before[k];
                set_state(work, work->model->direction[k].own,
                          work->now.rest[k] + velocity / work->now.factor[k]);
            }
        }
    }
    measure(work);
    find_rest_now(work);
}

/* True if a direction on a stop leaves it and comes back from no more than the tolerance of its
 * position: at v^2 / (2 |a|), where the acceleration points into the stop. */
static bool hardly_leaves(const struct work *work, int k) {
    const double velocity = work->now.velocity[k];
    if (!(work->sense[k] * velocity > least_velocity(work, k)) || work->event == NULL) {
        return false;
    }
    const int e = work->stop[k];
    const double ratio = fabs(work->now.ratio[e]);
    const double into = -work->sense[k] * work->acceleration[k];
    const double most = 2.0 * into * fmax(work->event->rest, 1.0) * work->now.tolerance[e];
    return into > 0.0 && ratio * velocity * velocity <= most;
}

/* Solves for impulses that change velocities by as much as wanted, of members of all blocks. */
static void solve_impulses(const struct work *work, const int is_member[], const double change[],
                           double P[]) {
    for (int block = 0; block < work->model->block_count; block++) {
        int member[CONTACTS_MOST_COUPLED];
        struct box box;
        struct box_solution found;
        const int count = members(work, block, is_member, member);
        write_box(work, member, count, change, &box);
        for (int i = 0; i < count; i++) {
            box.a0[i] = -box.a0[i];
            box.low[i] = -INFINITY;
            box.high[i] = INFINITY;
        }
        box_solve(&box, &found);
        for (int i = 0; i < count; i++) {
            P[member[i]] = found.T[i];
        }
    }
}

/* Lets velocities be 0 that are nearly so: by impulses between them, if they follow from each
 * other; then to the last bit, where one state of each follows from the others. */
static void rest_exactly(struct work *work) {
    const int count = work->model->direction_count;
    bool is_near = true;
    for (int k = 0; k < count; k++) {
        is_near &= !work->rests[k] || work->model->direction[k].is_exact ||
                   fabs(work->now.velocity[k]) <= least_velocity(work, k);
        work->acceleration[k] = -work->now.velocity[k];
    }
    if (!is_near) {
        solve_impulses(work, work->rests, work->acceleration, work->hold);
        for (int k = 0; k < count; k++) {
            const int friction = work->friction[k];
            if (work->rests[k] && friction >= 0) {
                push(work, friction, -work->hold[k]);
            } else if (work->rests[k]) {
                push(work, work->stop[k], work->hold[k] / work->now.ratio[work->stop[k]]);
            }
        }
        measure(work);
    }
    bool changes = true;
    for (int pass = 0; pass < count && changes; pass++) {
        changes = false;
        for (int k = 0; k < count; k++) {
            const struct direction *direction = &work->model->direction[k];
            if (work->rests[k] && direction->is_exact &&
                states_of(work)[direction->own] != work->now.rest[k]) {
                set_state(work, direction->own, work->now.rest[k]);
                changes = true;
                measure(work);
            }
        }
    }
}

/* Finds which velocities are 0, where what is held may have drifted, and lets them be 0. */
static void find_rest(struct work *work) {
    for (int k = 0; k < work->model->direction_count; k++) {
        const double speed = fabs(work->now.velocity[k]);
        const int friction = work->friction[k];
        const bool has_halted = friction >= 0 && work->hit[friction] != 0;
        const bool may_rest = friction >= 0 || work->sense[k] != 0;
        const double most = is_held(work, k) && !work->model->direction[k].is_plain
                                ? drift * work->now.size[k] + work->now.slack[k]
                                : least_velocity(work, k);
        work->rests[k] = may_rest && (has_halted || speed <= most);
        if (has_halted) {
            work->hit[friction] = 0;
        }
    }
    rest_exactly(work);
}

/* Ends bouncing: what hardly leaves its stop stays, with all that rests on stops. */
static void catch_on_stops(struct work *work) {
    const int count = work->model->direction_count;
    bool is_any = false;
    for (int k = 0; k < count; k++) {
        is_any |= work->sense[k] * work->now.velocity[k] > least_velocity(work, k);
    }
    if (!is_any) {
        return;
    }
    (void)decide(work);
    is_any = false;
    double *P = work->hold, *change = work->acceleration;
    int *caught = work->stop + count;
    for (int k = 0; k < count; k++) {
        const bool hardly = hardly_leaves(work, k);
        const double speed = fabs(work->now.velocity[k]);
        is_any |= hardly;
        caught[k] = hardly || (work->sense[k] != 0 && speed <= least_velocity(work, k));
    }
    if (!is_any) {
        return;
    }
    for (int k = 0; k < count; k++) {
        change[k] = -work->now.velocity[k];
        work->before[k] = work->now.velocity[k];
        P[k] = 0.0;
    }
    solve_impulses(work, caught, change, P);
    double *plastic = work->acceleration;
    memset(plastic, 0, (size_t)count * sizeof *plastic);
    apply_impulses(work, P, caught, plastic);
}

static bool moves_into_stop(const struct work *work) {
    bool found = false;
    for (int k = 0; k < work->model->direction_count; k++) {
        found |= work->sense[k] * work->now.velocity[k] < -least_velocity(work, k);
    }
    return found;
}

/* Applies one impact of all stops that are touched: impulses push only, and nothing moves into a
 * stop afterwards. */
static void strike(struct work *work, bool is_elastic) {
    const int count = work->model->direction_count;
    double *P = work->hold, *restitution = work->acceleration;
    int *touches = work->pattern;
    for (int k = 0; k < count; k++) {
        const double velocity = work->now.velocity[k];
        touches[k] = work->sense[k] != 0 && work->sense[k] * velocity <= least_velocity(work, k);
        restitution[k] = touches[k] && is_elastic ? work->now.restitution[work->stop[k]] : 0.0;
        work->before[k] = velocity;
        P[k] = 0.0;
    }
    for (int block = 0; block < work->model->block_count; block++) {
        int member[CONTACTS_MOST_COUPLED];
        struct box box;
        struct box_solution found;
        const int size = members(work, block, touches, member);
        write_box(work, member, size, work->before, &box);
        for (int i = 0; i < size; i++) {
            box.a0[i] *= 1.0 + restitution[member[i]];
            box.low[i] = work->sense[member[i]] > 0 ? 0.0 : -INFINITY;
            box.high[i] = work->sense[member[i]] > 0 ? INFINITY : 0.0;
        }
        box_solve(&box, &found);
        for (int i = 0; i < size; i++) {
            P[member[i]] = found.leaves[i] == 0 ? found.T[i] : 0.0;
            touches[member[i]] = found.leaves[i] == 0;
        }
    }
    apply_impulses(work, P, touches, restitution);
}

/* Applies impacts until nothing moves into its stop: one may drive into its stop what was leaving
 * another. From some number on they are plastic, and one or two more end them. */
static void apply_impacts(struct work *work) {
    enum { MOST_ELASTIC = 8, MOST = 16 };
    catch_on_stops(work);
    for (int count = 0; count < MOST && moves_into_stop(work); count++) {
        strike(work, count < MOST_ELASTIC);
        catch_on_stops(work);
    }
}

/* ---- Modes ----------------------------------------------------------------------------------- */

static void write_modes(const struct work *work) {
    for (int e = 0; e < work->model->contact_count; e++) {
        const struct contact *contact = &work->model->contact[e];
        const int k = contact->direction;
        const int sign = work->rests[k] ? work->pattern[k] : sign_of(work->now.velocity[k]);
        int mode = contact->is_friction ? FRICTION_FORWARD : STOPS_FREE;
        if (contact->is_friction && work->now.active[e] != 0.0) {
            mode = work->rests[k] && sign == 0 ? FRICTION_STUCK
                   : sign < 0                  ? FRICTION_BACKWARD
                                               : FRICTION_FORWARD;
        } else if (!contact->is_friction && work->rests[k] && sign == 0 && work->sense[k] != 0 &&
                   work->stop[k] == e) {
            const bool is_lower = work->sense[k] * sign_of(work->now.ratio[e]) > 0;
            mode = is_lower ? STOPS_LOWER : STOPS_UPPER;
        }
        *mode_of(work, e) = mode;
    }
}

/* Returns the place of the limit that ends the rest of a direction in a sense. */
static int limit_of(const struct work *work, int k, int sign) {
    const int friction = work->friction[k];
    const int contact = friction >= 0 ? friction : work->stop[k];
    const int is_second = friction >= 0 ? sign < 0 : sense_of(work, contact, STOPS_LOWER) != sign;
    return 2 * contact + is_second;
}

/* Returns the sense in which a direction that stays is at its limit, or 0. */
static int side_at_limit(const struct work *work, int k) {
    const struct compared *compared = work->call->room.compared;
    for (int sign = 1; sign >= -1 && work->rests[k] && work->pattern[k] == 0; sign -= 2) {
        const bool is_open = work->sense[k] == 0 || work->sense[k] == sign;
        const bool may_leave = is_open && (work->friction[k] >= 0 || work->sense[k] == sign);
        const struct compared *limit = &compared[limit_of(work, k, sign)];
        const bool is_near = work->leaves[k] == sign && limit->distance <= limit->noise;
        if (may_leave && (limit->distance <= 0.0 || is_near)) {
            return sign;
        }
    }
    return 0;
}

/* True if the force that holds a direction may be at its limit: seen without errors, as an event or
 * by rounding. */
static bool may_break_away(const struct work *work, int k) {
    const double near = 1e-3; // of the force and of its bound: far above rounding
    if (!work->rests[k] || work->pattern[k] != 0) {
        return false;
    }
    const int friction = work->friction[k];
    const double limit = friction >= 0 ? work->now.breakaway[friction] : 0.0;
    const double force = work->hold[k];
    const double scale = near * (limit + fabs(force));
    const bool is_low = work->sense[k] >= 0 && force + limit <= scale;
    const bool is_high = work->sense[k] <= 0 && limit - force <= scale;
    return work->leaves[k] != 0 || is_low || is_high;
}

/* Decides what is at its limit by the rates of the forces: they fall below it, or what holds has
 * triggered and they rest. */
static bool break_away(struct work *work) {
    const struct compared *compared = work->call->room.compared;
    const int count = work->model->direction_count;
    int *side = work->stop + count;
    bool is_any = false;
    for (int k = 0; k < count; k++) {
        is_any |= may_break_away(work, k);
    }
    if (!is_any) {
        return false;
    }
    is_any = false;
    modes_compare_limits(work->call, work->call->room.compared);
    for (int k = 0; k < count; k++) {
        side[k] = side_at_limit(work, k);
        is_any |= side[k] != 0;
    }
    if (!is_any) {
        return false;
    }
    const bool is_known = work->event == NULL || work->event->du_is_known;
    bool leaves = false;
    for (int block = 0; block < work->model->block_count; block++) {
        int member[CONTACTS_MOST_COUPLED];
        int at[CONTACTS_MOST_COUPLED];
        struct box box;
        struct box_solution found;
        int limits = 0;
        const int size = members(work, block, work->rests, member);
        int stays = 0;
        for (int i = 0; i < size; i++) {
            if (work->pattern[member[i]] == 0) {
                member[stays++] = member[i];
            }
        }
        for (int i = 0; i < stays; i++) {
            if (side[member[i]] != 0) {
                at[limits++] = i;
            }
        }
        struct box inverse;
        box.count = limits;
        for (int j = 0; j < limits; j++) {
            const int own = side[member[at[j]]];
            write_box(work, member, stays, work->now.velocity, &inverse);
            for (int i = 0; i < stays; i++) {
                inverse.a0[i] = i == at[j] ? -own : 0.0;
                inverse.low[i] = -INFINITY;
                inverse.high[i] = INFINITY;
            }
            box_solve(&inverse, &found);
            for (int i = 0; i < limits; i++) {
                box.W[i][j] = side[member[at[i]]] * found.T[at[i]];
            }
            box.a0[j] = compared[limit_of(work, member[at[j]], own)].slope;
            box.low[j] = 0.0;
            box.high[j] = INFINITY;
        }
        box_solve(&box, &found);
        for (int j = 0; j < limits; j++) {
            const int k = member[at[j]];
            const bool falls = found.leaves[j] == 0 && found.T[j] > 0.0;
            const bool may = work->leaves[k] == side[k] && (box.a0[j] == 0.0 || !is_known);
            if (falls || may) {
                work->pattern[k] = side[k];
                leaves = true;
            }
        }
    }
    return leaves;
}

static struct work work_of(const struct call *call, const struct event *event) {
    const struct contacts *model = call->model->contacts;
    const struct contacts_room room = call->room.contacts;
    const int directions = model->direction_count;
    struct work work = {.call = call, .model = model, .event = event};
    work.now = measured_in(model, room.measured);
    work.hold = room.hold;
    work.acceleration = work.hold + directions;
    work.before = work.acceleration + directions;
    work.sense = room.found;
    work.rests = work.sense + directions;
    work.pattern = work.rests + directions;
    work.leaves = work.pattern + directions;
    work.stop = work.leaves + directions;
    work.friction = work.stop + 2 * directions;
    work.hit = work.friction + directions;
    work.struck = work.hit + model->contact_count;
    work.modes = work.struck + model->contact_count;
    return work;
}

/* Returns STATUS_INTERNAL, with the reason: no motion fits all contacts. */
static enum status refuse_motion(const struct work *work) {
    if (work->event == NULL || work->event->reason == NULL) {
        return STATUS_INTERNAL;
    }
    char *to = work->event->reason;
    const size_t size = work->event->reason_size;
    (void)snprintf(to, size, "no motion fits");
    for (int k = 0, named = 0; k < work->model->direction_count; k++) {
        const int friction = work->friction[k];
        const int e = friction >= 0 ? friction : work->stop[k];
        if (work->rests[k]) {
            const size_t length = strlen(to);
            (void)snprintf(to + length, size - length, "%s%s", named++ ? " and " : " ",
                           work->model->contact[e].name);
        }
    }
    return STATUS_INTERNAL;
}

enum status contacts_update(const struct call *call, const struct event *event, bool is_first,
                            bool is_start, bool *changes) {
    struct work work = work_of(call, event);
    measure(&work);
    find_frictions(&work);
    const enum status status = check(&work, is_start);
    if (status != STATUS_OK && event != NULL) {
        return status;
    }
    if (is_first) {
        read_triggered(&work);
        memset(work.struck, 0, (size_t)work.model->contact_count * sizeof *work.struck);
    }
    for (int e = 0; e < work.model->contact_count; e++) {
        work.modes[e] = *mode_of(&work, e);
    }
    place_on_stops(&work);
    find_rest(&work);
    apply_impacts(&work);
    if (!decide(&work)) {
        return refuse_motion(&work);
    }
    write_modes(&work);
    if (break_away(&work)) {
        write_modes(&work);
    }
    *changes |= work.jumps;
    for (int e = 0; e < work.model->contact_count; e++) {
        *changes |= work.modes[e] != *mode_of(&work, e);
    }
    return STATUS_OK;
}
