#include "relations.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Of a state's size: how far from its limit it may be where its event is located. */
static const double location_error = 1e-11;

/* What is called on the way of one event: a model, its values, and memory. */
struct call {
    const struct relations *model;
    struct relations_room room;
    void *values;
    int *is_begun, *holds, *active; /* its modes */
    double t;                       /* s */
};

static const int *modes_in(const struct relations *model, const void *values) {
    return (const int *)(const void *)((const char *)values + model->modes.offset);
}

static struct call call_of(const struct relations *model, struct relations_room room, void *values,
                           double t) {
    int *modes = (int *)(void *)((char *)values + model->modes.offset);
    int *holds = modes + 1;
    return (struct call){model, room, values, modes, holds, holds + model->relation_count, t};
}

static bool holds_at(const struct relation *relation, double distance) {
    return relation->includes_zero ? distance >= 0.0 : distance > 0.0;
}

/* A relation near its limit keeps its mode: where it was located, rounding says nothing. */
static bool settle(const struct call *call) {
    const struct relation *relation = call->model->relation;
    struct compared *compared = call->room.compared;
    bool changes = false;
    call->model->compare(call->values, call->t, call->room.tolerance, compared);
    for (int k = 0; k < call->model->relation_count; k++) {
        const int holds = holds_at(&relation[k], compared[k].distance);
        const bool is_sure = !compared[k].used || fabs(compared[k].distance) >= compared[k].noise;
        if (is_sure && !relation[k].is_timed && call->holds[k] != holds) {
            call->holds[k] = holds;
            changes = true;
        }
    }
    return changes;
}

/* Modes may depend on each other, in a circle even: then the last ones stay. */
static void settle_all(const struct call *call) {
    for (int count = 0; count <= call->model->relation_count && settle(call); count++) {
    }
}

/* Lets relations follow from the values, whatever their modes were. */
static void follow(const struct call *call, bool only_of_inputs) {
    const struct relations *model = call->model;
    const struct compared *compared = call->room.compared;
    for (int i = 0; i < model->state_count; i++) {
        call->room.tolerance[i] = 0.0;
    }
    model->compare(call->values, call->t, call->room.tolerance, call->room.compared);
    for (int k = 0; k < model->relation_count; k++) {
        if (model->relation[k].is_of_inputs || !only_of_inputs) {
            call->holds[k] = holds_at(&model->relation[k], compared[k].distance);
        }
    }
    if (!only_of_inputs) {
        settle_all(call);
    }
}

const void *relations_followed(const struct relations *model, struct relations_room room,
                               const void *values, double t, void *copy) {
    const int is_begun = *modes_in(model, values);
    if (is_begun && !model->has_inputs) {
        return values;
    }
    memcpy(copy, values, model->values_size);
    const struct call call = call_of(model, room, copy, t);
    follow(&call, is_begun);
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

/* Runs the events that have become due, in their order; false: there was none. */
static bool fire(const struct call *call) {
    const struct relations *model = call->model;
    int *due = call->room.due;
    bool fires = false;
    for (int i = 0; i < model->event_count; i++) {
        model->find_due(call->values, call->t, due);
        if (due[i] && !call->active[i]) {
            model->change(call->values, call->t, i, call->room.tolerance);
            settle_all(call);
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

/* Relations with the same limit switch at one event: those on it that are about to pass it. */
static bool joins(const struct compared *compared, int holds) {
    const double slope = holds ? compared->slope : -compared->slope;
    const bool is_near = fabs(compared->distance) < compared->noise;
    return compared->used && is_near && slope < 0.0;
}

static void pass(const struct call *call, const struct event *event) {
    const struct relations *model = call->model;
    const struct relations_room room = call->room;
    const double next = relations_next_time(model, room, call->values); /* writes all times */
    const double passed = event->is_timed ? next : -INFINITY;
    model->compare(call->values, call->t, room.tolerance, room.compared);
    for (int k = 0; k < model->relation_count; k++) {
        const struct relation *relation = &model->relation[k];
        if (relation->is_timed) {
            const bool is_past = call->t >= room.times[k] || room.times[k] <= passed;
            call->holds[k] = is_past == relation->rises;
        } else if (event->triggered != NULL) {
            const bool is_on_it = joins(&room.compared[k], call->holds[k]);
            call->holds[k] ^= event->triggered[relation->indicator] || is_on_it;
        }
    }
    settle_all(call);
}

enum status relations_update(const struct relations *model, struct relations_room room,
                             void *values, const struct event *event) {
    const struct call call = call_of(model, room, values, event->t);
    const double *x = (const double *)(const void *)((const char *)values + model->states);
    double *tolerance = room.tolerance;
    const int was_begun = *call.is_begun;
    if (!was_begun) {
        follow(&call, false);
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
        if (!fire(&call)) {
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

bool relations_are_plausible(const struct relations *model, const void *values) {
    const int *modes = modes_in(model, values);
    const size_t count = model->modes.size / sizeof *modes;
    bool are_fine = modes[0] == 1;
    for (size_t i = 0; i < count; i++) {
        are_fine = are_fine && (modes[i] == 0 || modes[i] == 1);
    }
    return are_fine;
}
