#include "relations.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Relative distance of a state from its limit where its event may be located; and of the time. */
static const double location_error = 1e-11;
static const double time_error = 1e-12;

/* Arguments of all functions during one event: a model, its values, and memory. */
struct call {
    const struct relations *model;
    struct relations_room room;
    void *values;
    int *is_begun, *holds, *active; /* parts of its modes */
    double t;                       /* s */
    const double *du;               /* derivative of each input by the time */
    bool inputs_move;
};

static const int *modes_in(const struct relations *model, const void *values) {
    return (const int *)(const void *)((const char *)values + model->modes.offset);
}

static struct call call_of(const struct relations *model, struct relations_room room, void *values,
                           double t, const double du[]) {
    int *modes = (int *)(void *)((char *)values + model->modes.offset);
    int *holds = modes + 1;
    bool inputs_move = false;
    for (int i = 0; i < model->input_count; i++) {
        inputs_move |= du[i] != 0.0;
    }
    return (struct call){model, room, values,     modes, holds, holds + model->relation_count,
                         t,     du,   inputs_move};
}

/* Compares all relations. state_errors: how far from its limit each state may have been located, in
 * its unit. */
static void compare(const struct call *call, const double state_errors[],
                    struct compared compared[]) {
    const double inputs = call->inputs_move ? time_error : 0.0; // inputs that do not move are exact
    const struct given given = {state_errors, time_error, inputs, call->du};
    call->model->compare(call->values, call->t, &given, compared);
}

static bool holds_at(const struct relation *relation, double distance) {
    return relation->includes_zero ? distance >= 0.0 : distance > 0.0;
}

/* True if the relation is at its limit, within its noise. */
static bool is_near(const struct compared *compared) {
    return fabs(compared->distance) <= compared->noise;
}

/* True if the distance tells which mode is right. Without a reader the distance may be NaN, and
 * counts. */
static bool is_sure(const struct compared *compared) {
    const double size = fabs(compared->distance);
    return compared->used ? size >= compared->noise : !(size < compared->noise);
}

/* Updates the modes of relations by their distances. A relation at its limit keeps its mode, as
 * does a turned one. Returns true if some have changed. is_exact: distances are exact to the last
 * bit. */
static bool update_modes(const struct call *call, bool is_exact) {
    const struct relation *relation = call->model->relation;
    struct compared *compared = call->room.compared;
    bool changes = false;
    compare(call, call->room.tolerance, compared);
    for (int k = 0; k < call->model->relation_count; k++) {
        const int holds = holds_at(&relation[k], compared[k].distance);
        const bool follows = is_exact || (is_sure(&compared[k]) && !call->room.turned[k]);
        if (follows && !relation[k].is_timed && call->holds[k] != holds) {
            call->holds[k] = holds;
            changes = true;
        }
    }
    return changes;
}

/* Repeats update_modes until no mode changes. Modes may depend on each other in a circle: then the
 * last ones stay. */
static void update_modes_until_stable(const struct call *call, bool is_exact) {
    for (int count = 0; count <= call->model->relation_count && update_modes(call, is_exact);
         count++) {
    }
}

/* Writes the modes that follow from the values, whatever they were before. */
static void set_modes_from_values(const struct call *call, bool only_of_inputs) {
    const struct relations *model = call->model;
    const struct compared *compared = call->room.compared;
    compare(call, call->room.zeros, call->room.compared);
    for (int k = 0; k < model->relation_count; k++) {
        if (model->relation[k].is_of_inputs || !only_of_inputs) {
            call->holds[k] = holds_at(&model->relation[k], compared[k].distance);
        }
    }
    if (!only_of_inputs) {
        update_modes_until_stable(call, true);
    }
}

const void *relations_followed(const struct relations *model, struct relations_room room,
                               const void *values, double t, void *copy) {
    const int is_begun = *modes_in(model, values);
    if (is_begun && !model->has_inputs) {
        return values;
    }
    memcpy(copy, values, model->values_size);
    const struct call call = call_of(model, room, copy, t, room.zeros);
    set_modes_from_values(&call, is_begun);
    return copy;
}

double relations_next_time(const struct relations *model, struct relations_room room,
                           const void *values) {
    const int *modes = modes_in(model, values);
    double next = INFINITY;
    model->write_times(values, room.times);
    for (int k = 0; k < model->relation_count && modes[0]; k++) {
        const struct relation *relation = &model->relation[k];
        const bool is_ahead = relation->is_timed && modes[1 + k] != relation->rises;
        next = is_ahead ? fmin(next, room.times[k]) : next;
    }
    return next;
}

/* Returns the slope of the distance with the sign of the mode. */
static double signed_slope(const struct compared *compared, int holds) {
    return holds ? compared->slope : -compared->slope;
}

/* Switches relations after an event has changed values: a relation at its limit that now falls
 * switches, or its next event would be due at once; a relation that the event has placed at its
 * limit, at rest, holds if it includes zero. The motion of inputs may not be known, but it is part
 * of the slopes before and after the change.
 *
 * call->room.before: the relations before the change. */
static void switch_fallen(const struct call *call) {
    const struct relations *model = call->model;
    const struct compared *before = call->room.before;
    struct compared *after = call->room.compared;
    compare(call, call->room.tolerance, after);
    for (int k = 0; k < model->relation_count; k++) {
        const double slope = signed_slope(&after[k], call->holds[k]);
        const bool falls = slope < 0.0 && slope < signed_slope(&before[k], call->holds[k]);
        const bool may_turn = !model->relation[k].is_timed && is_near(&after[k]);
        call->room.turned[k] = may_turn && falls;
        call->holds[k] ^= may_turn && falls;
    }
    compare(call, call->room.zeros, after);
    for (int k = 0; k < model->relation_count; k++) {
        const bool rests = after[k].slope == 0.0 && signed_slope(&before[k], call->holds[k]) > 0.0;
        if (!model->relation[k].is_timed && is_near(&after[k]) && rests) {
            call->room.turned[k] = 1;
            call->holds[k] = model->relation[k].includes_zero;
        }
    }
}

/* Runs the events that have become due, in their order. Returns false if there was none. */
static bool run_due_events(const struct call *call) {
    const struct relations *model = call->model;
    int *due = call->room.due;
    bool fires = false;
    for (int i = 0; i < model->event_count; i++) {
        model->find_due(call->values, call->t, due);
        if (due[i] && !call->active[i]) {
            compare(call, call->room.tolerance, call->room.before);
            model->change(call->values, call->t, i, call->room.tolerance);
            update_modes_until_stable(call, false);
            switch_fallen(call);
            update_modes_until_stable(call, false);
            memset(call->room.turned, 0, (size_t)model->relation_count * sizeof *call->room.turned);
            call->active[i] = 1;
            fires = true;
        }
        model->find_due(call->values, call->t, due);
        for (int k = 0; k < model->event_count; k++) {
            call->active[k] = call->active[k] && due[k];
        }
    }
    return fires;
}

/* True if a relation at its limit is about to pass it, so that it switches together with another
 * relation of the same limit. It need not be read yet. */
static bool joins(const struct compared *compared, int holds) {
    return is_near(compared) && signed_slope(compared, holds) < 0.0;
}

static void pass(const struct call *call, const struct event *event) {
    const struct relations *model = call->model;
    const struct relations_room room = call->room;
    const double next = relations_next_time(model, room, call->values); /* also writes all times */
    const double passed = event->is_timed ? next : -INFINITY;
    compare(call, room.tolerance, room.compared);
    for (int k = 0; k < model->relation_count; k++) {
        const struct relation *relation = &model->relation[k];
        if (relation->is_timed) {
            const bool is_past = call->t >= room.times[k] || room.times[k] <= passed;
            call->holds[k] = is_past == relation->rises;
        } else if (event->triggered != NULL) {
            // if a state is at its limit within its error, its indicator may only seem to fall
            const double slope = signed_slope(&room.compared[k], call->holds[k]);
            const bool falls =
                event->triggered[relation->indicator] && !(event->du_is_known && slope > 0.0);
            call->holds[k] ^= falls || joins(&room.compared[k], call->holds[k]);
        }
    }
    update_modes_until_stable(call, false);
}

enum status relations_update(const struct relations *model, struct relations_room room,
                             void *values, const struct event *event) {
    const struct call call = call_of(model, room, values, event->t, event->du);
    const double *x = (const double *)(const void *)((const char *)values + model->states);
    double *tolerance = room.tolerance;
    const int was_begun = *call.is_begun;
    if (!was_begun) {
        set_modes_from_values(&call, false);
        *call.is_begun = 1;
    }
    for (int i = 0; i < model->state_count; i++) {
        const double located = location_error * (model->nominal[i] + fabs(x[i]));
        tolerance[i] = fmax(event->tolerance[i], located);
    }
    if (was_begun) {
        pass(&call, event);
    }
    for (int count = 0; count <= event->max_events; count++) {
        if (!run_due_events(&call)) {
            return STATUS_OK;
        }
    }
    if (event->reason != NULL) {
        (void)snprintf(event->reason, event->reason_size,
                       "events follow each other more than max_events = %d times",
                       event->max_events);
    }
    return STATUS_INTERNAL;
}

void relations_errors(const struct relations *model, struct relations_room room, const void *values,
                      double t, const double state_errors[], double relative, double errors[]) {
    const struct given given = {state_errors, relative, relative, room.zeros};
    model->compare(values, t, &given, room.compared);
    for (int k = 0; k < model->relation_count; k++) {
        if (!model->relation[k].is_timed) {
            const double noise = room.compared[k].noise;
            errors[model->relation[k].indicator] = isfinite(noise) ? noise : 0.0;
        }
    }
}

bool relations_are_plausible(const struct relations *model, const void *values) {
    const int *modes = modes_in(model, values);
    const size_t count = model->modes.size / sizeof *modes;
    bool are_fine = modes[0] == 1;
    for (size_t i = 0; i < count; i++) {
        are_fine = are_fine && (modes[i] == 0 || modes[i] == 1);
    }
    return are_fine;
}
