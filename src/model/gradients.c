#include "gradients.h"

#include "relations_modes.h"

#include <math.h>
#include <stdio.h>

static const double same = 1e-6;    // relative difference of shifts that count as equal
static const double flat = 1e-9;    // relative size of a slope that counts as 0
static const double small = 1e-6;   // relative change of a parameter that may add or drop an event
static const double no_jump = 1e-9; // relative difference of rates that counts as none

static double *states_of(const struct call *call) {
    return (double *)(void *)((char *)call->values + call->model->states);
}

static int *exactness_of(const struct call *call) {
    return (int *)(void *)((char *)call->values + call->model->gradients->are_exact);
}

static double *shifts_of(const struct call *call, int part) {
    return call->room.gradients.shift + (ptrdiff_t)part * call->model->gradients->count;
}

/* Adds a cause, by its place among all of them, whose shifts may be wrong by `noise` each. */
static void add_cause(const struct call *call, int place, const char *name, const double shift[],
                      const double noise[]) {
    const struct gradients *gradients = call->model->gradients;
    const struct gradients_room *room = &call->room.gradients;
    const int part = gradients->part_of_cause[place];
    double *known = shifts_of(call, part);
    double *error = room->noise + (ptrdiff_t)part * gradients->count;
    const char *first = room->cause[part];
    for (int j = 0; j < gradients->count; j++) {
        if (first == NULL) {
            known[j] = shift[j];
            error[j] = noise[j];
        } else if (!(fabs(shift[j] - known[j]) <= noise[j] + error[j])) {
            room->departure->other[0] = first;
            room->departure->other[1] = name;
        }
    }
    room->cause[part] = first == NULL ? name : first;
}

static struct crossing crossing_of(const struct call *call, int relation) {
    const struct gradients *gradients = call->model->gradients;
    double *by = call->room.gradients.by;
    struct crossing found = {.by = by, .sizes = by + gradients->count};
    gradients->cross(call->values, call->t, call->du, call->room.gradients.rate, relation, &found);
    return found;
}

/* True if a small change of a parameter moves a distance by this. */
static bool is_within_reach(const struct call *call, const struct crossing *crossing,
                            double distance) {
    const struct gradients *gradients = call->model->gradients;
    bool is_near = false;
    for (int j = 0; j < gradients->count; j++) {
        is_near |= distance < small * gradients->size[j] * fabs(crossing->by[j]);
    }
    return is_near;
}

/* Adds a relation that comes to its limit. */
static void add_crossing(const struct call *call, const struct event *event, int relation) {
    const struct gradients *gradients = call->model->gradients;
    struct departure *departure = call->room.gradients.departure;
    struct crossing found = crossing_of(call, relation);
    const bool is_flat = !(fabs(found.slope) > flat * found.size);
    // how far from here the slope is 0, ahead or behind: a multiple root may be located beside it
    const double depth = 0.5 * found.slope * found.slope / fabs(found.curvature);
    const bool is_kink = relation < call->model->relation_count && gradients->is_kink[relation];
    if (!is_kink && (is_flat || is_within_reach(call, &found, depth))) {
        departure->doubtful = gradients->names[relation];
    }
    if (found.is_of_input && !event->du_is_known) {
        departure->driven = gradients->names[relation];
    }
    for (int j = 0; j < gradients->count; j++) {
        found.by[j] = is_flat ? 0.0 : -found.by[j] / found.slope;
        found.sizes[j] = is_flat ? INFINITY : same * found.sizes[j] / fabs(found.slope);
    }
    add_cause(call, relation, gradients->names[relation], found.by, found.sizes);
}

/* Looks at a distance that turns before it has come to 0. */
static void look_at_turn(const struct call *call, int relation) {
    const struct crossing found = crossing_of(call, relation);
    const struct compared *compared = &call->room.compared[relation];
    if (compared->used && is_within_reach(call, &found, fabs(compared->distance))) {
        call->room.gradients.departure->missed = call->model->gradients->names[relation];
    }
}

static void add_tick(const struct call *call, int sampler) {
    const struct relations *model = call->model;
    double *shift = call->room.gradients.by;
    double *noise = shift + model->gradients->count;
    model->gradients->tick(call->values, sampler, shift);
    for (int j = 0; j < model->gradients->count; j++) {
        noise[j] = same * fabs(shift[j]);
    }
    const int limits = model->contacts != NULL ? 2 * model->contacts->contact_count : 0;
    add_cause(call, model->relation_count + limits + sampler,
              model->change_names[model->event_count + sampler], shift, noise);
}

/* Adds time events that come now. */
static void add_time_events(const struct call *call, const struct event *event) {
    const struct relations *model = call->model;
    model->write_times(call->values, call->room.times);
    for (int k = 0; k < call->relation_count; k++) {
        const bool has_passed = call->room.times[k] <= call->passed;
        if (model->relation[k].is_timed &&
            (has_passed == model->relation[k].rises) != call->holds[k]) {
            add_crossing(call, event, k);
        }
    }
    for (int i = 0; i < model->sampler_count; i++) {
        if (relations_is_due(call, i, call->t, &(double){0.0})) {
            add_tick(call, i);
        }
    }
}

/* Adds limits of friction and stops that are met. */
static void add_limits(const struct call *call, const struct event *event) {
    const struct contacts *contacts = call->model->contacts;
    const int count = contacts != NULL ? 2 * contacts->contact_count : 0;
    for (int i = 0; i < count; i++) {
        const int place = call->model->relation_count + i;
        if (event->triggered[contacts->indicator + (size_t)i] &&
            !(event->du_is_known && crossing_of(call, place).slope > 0.0)) {
            add_crossing(call, event, place);
        }
    }
}

/* Adds the rates, times the shifts and the sign, to the gradients of all states. */
static void move(const struct call *call, const double rate[], double sign) {
    const struct gradients *gradients = call->model->gradients;
    const int count = gradients->state_count;
    double *gradient = states_of(call) + count;
    for (int i = 0; i < count; i++) {
        const double *shift = shifts_of(call, gradients->part_of_state[i]);
        for (int j = 0; j < gradients->count; j++) {
            gradient[j * count + i] += shift[j] != 0.0 ? sign * shift[j] * rate[i] : 0.0;
        }
    }
}

void gradients_depart(const struct call *call, const struct event *event) {
    const struct gradients *gradients = call->model->gradients;
    const struct gradients_room *room = &call->room.gradients;
    if (event->triggered == NULL) {
        return;
    }
    room->departure->has_departed = true;
    gradients->rates(call->values, call->t, room->rate);
    add_time_events(call, event);
    for (int k = 0; k < call->relation_count; k++) {
        const bool turns = call->room.turned[k] != 0;
        if (turns && gradients->watched[k] >= 0) {
            look_at_turn(call, gradients->watched[k]);
        }
        if (turns && k < gradients->relation_count && call->room.compared[k].used) {
            add_crossing(call, event, k);
        }
    }
    add_limits(call, event);
    move(call, room->rate, 1.0);
}

/* Looks at relations that begin at their limits, whose derivatives along with the event are not 0:
 * with another parameter they begin on one side or on the other. */
static void look_at_ties(const struct call *call) {
    const struct gradients *gradients = call->model->gradients;
    modes_compare(call, call->room.tolerance, call->room.compared);
    const int count = call->relation_count > 0 ? gradients->relation_count : 0;
    for (int k = 0; k < count; k++) {
        const struct compared *compared = &call->room.compared[k];
        if (gradients->is_kink[k] || !compared->used || !modes_near(compared)) {
            continue;
        }
        const struct crossing found = crossing_of(call, k);
        const double *shift = shifts_of(call, gradients->part_of_cause[k]);
        for (int j = 0; j < gradients->count; j++) {
            const double drift = found.drift * shift[j];
            // of the gradients before they have moved with the event, too
            const double size = found.sizes[j] + fabs(drift) + fabs(found.slope * shift[j]);
            if (fabs(found.by[j] + drift) > same * size) {
                call->room.gradients.departure->tied = gradients->names[k];
            }
        }
    }
}

/* Writes once from when on the gradients are not exact, and why. */
static void note_doubt(const struct call *call, const struct event *event) {
    const struct departure *departure = call->room.gradients.departure;
    const char *touched = departure->missed != NULL ? departure->missed : departure->doubtful;
    int *are_exact = exactness_of(call);
    const bool were_exact = *are_exact != 0;
    *are_exact = 0;
    if (!were_exact || event->note == NULL) {
        return;
    }
    if (touched != NULL) {
        (void)snprintf(event->note, event->note_size,
                       "%.100s: it is only touched, and another parameter may let it happen or not",
                       touched);
    } else if (departure->tied != NULL) {
        (void)snprintf(event->note, event->note_size,
                       "%.100s begins exactly at its limit, and another parameter moves it to one "
                       "side or the other",
                       departure->tied);
    } else if (departure->other[0] != NULL) {
        (void)snprintf(event->note, event->note_size,
                       "%.100s and %.100s come at once, and another parameter changes their order",
                       departure->other[0], departure->other[1]);
    } else {
        (void)snprintf(event->note, event->note_size,
                       "%.100s: inputs take part, and in Model Exchange their motion is not known",
                       departure->driven);
    }
}

void gradients_arrive(const struct call *call, const struct event *event, bool is_start) {
    const struct gradients *gradients = call->model->gradients;
    const struct gradients_room *room = &call->room.gradients;
    const struct departure *departure = room->departure;
    if (is_start || departure->has_departed || departure->jumps) {
        look_at_ties(call);
    }
    if (departure->tied != NULL && !departure->has_departed) {
        note_doubt(call, event);
    }
    if (!departure->has_departed) {
        return;
    }
    const int count = gradients->state_count;
    const double *before = room->rate;
    double *after = room->rate + count;
    gradients->rates(call->values, call->t, after);
    move(call, after, -1.0);
    bool jumps = departure->jumps;
    for (int i = 0; i < count; i++) {
        const double size = fabs(before[i]) + fabs(after[i]);
        jumps |= fabs(after[i] - before[i]) > no_jump * size;
    }
    const bool is_doubtful =
        departure->doubtful != NULL || departure->other[0] != NULL || departure->driven != NULL;
    if (departure->missed != NULL || departure->tied != NULL || (jumps && is_doubtful)) {
        note_doubt(call, event);
    }
}
