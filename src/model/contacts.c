#include "contacts_work.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const double drift = 1e-10; // of a velocity that is held, between events, over its terms

struct contacts_measured contacts_measured_in(const struct contacts *model, double *room) {
    const ptrdiff_t directions = model->direction_count, contacts = model->contact_count;
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

static bool is_held(const struct work *work, int direction) {
    bool found = false;
    for (int e = 0; e < work->model->contact_count; e++) {
        const struct contact *contact = &work->model->contact[e];
        const int mode = *mode_of(work, e);
        const bool holds = contact->is_friction ? mode == FRICTION_STUCK : mode != STOPS_FREE;
        found |= contact->direction == direction && holds;
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
    const double near = 2.0 * now->tolerance[e] + CONTACTS_ROUNDING * fabs(now->position[e]);
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
    contacts_rest_exactly(work);
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

static struct work work_of(const struct call *call, const struct event *event) {
    const struct contacts *model = call->model->contacts;
    const struct contacts_room room = call->room.contacts;
    const ptrdiff_t directions = model->direction_count;
    struct work work = {.call = call, .model = model, .event = event};
    work.now = contacts_measured_in(model, room.measured);
    work.hold = room.hold;
    work.acceleration = work.hold + directions;
    work.before = work.acceleration + directions;
    work.sense = room.found;
    work.rests = work.sense + directions;
    work.pattern = work.rests + directions;
    work.leaves = work.pattern + directions;
    work.stop = work.leaves + directions;
    work.marked = work.stop + directions;
    work.friction = work.marked + directions;
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
    const enum status status = contacts_check(&work, is_start);
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
    contacts_apply_impacts(&work);
    if (!contacts_decide(&work)) {
        return refuse_motion(&work);
    }
    write_modes(&work);
    if (contacts_break_away(&work)) {
        write_modes(&work);
    }
    if (work.model->hold_gradients != NULL) {
        work.model->hold_gradients(&work);
    }
    *changes |= work.jumps;
    for (int e = 0; e < work.model->contact_count; e++) {
        *changes |= work.modes[e] != *mode_of(&work, e);
    }
    return STATUS_OK;
}
