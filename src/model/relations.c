#include "relations_modes.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

/* Relative distance of a state from its limit where its event may be located. */
static const double location_error = 1e-11;
static const double shortest_period = 1e-12;  // s, of samplers
static const double part_of_period = 0x1p-40; // that counts as rounding

static const double *states_in(const struct relations *model, const void *values) {
    return (const double *)(const void *)((const char *)values + model->states);
}

static double *discrete_of(const struct call *call) {
    return (double *)(void *)((char *)call->values + call->model->discrete.offset);
}

/* Updates the modes of timed relations. Their times may follow from discrete variables. */
static void update_timed_modes(const struct call *call) {
    const struct relations *model = call->model;
    model->write_times(call->values, call->room.times);
    for (int k = 0; k < call->relation_count; k++) {
        const struct relation *relation = &model->relation[k];
        if (relation->is_timed) {
            call->holds[k] = (call->room.times[k] <= call->passed) == relation->rises;
        }
    }
}

/* Writes why an expression is refused. */
static enum status refuse(const struct call *call, const struct event *event,
                          const struct assignment *refused) {
    const char *name = refused->event < 0 ? "start" : call->model->change_names[refused->event];
    if (event->reason != NULL) {
        (void)snprintf(event->reason, event->reason_size, "%s: %.150s is not finite", name,
                       refused->text);
    }
    if (event->text != NULL) {
        *event->text = strchr(refused->text, '=') + 1;
    }
    return STATUS_NOT_FINITE;
}

/* Returns STATUS_NOT_FINITE, with the reason, if a condition or whole number of an event, or of
 * RELATIONS_START or RELATIONS_CONDITIONS, has no value. */
static enum status check_defined(const struct call *call, int number, const struct event *event) {
    const struct relations *model = call->model;
    if (model->undefined == NULL) {
        return STATUS_OK;
    }
    const char *undefined =
        model->undefined(call->values, call->t, relations_later(call->t, call->error), number);
    if (undefined == NULL) {
        return STATUS_OK;
    }
    if (event->reason != NULL) {
        (void)snprintf(event->reason, event->reason_size, "%.200s has no value", undefined);
    }
    if (event->text != NULL) {
        *event->text = strchr(undefined, '=') + 1;
    }
    return STATUS_NOT_FINITE;
}

/* Returns STATUS_NOT_FINITE, with the reason, if a whole number is none that an int holds. */
static enum status check_counts(const struct call *call, const struct event *event) {
    const struct relations *model = call->model;
    const int *counts = call->segments + model->segment_count;
    int found = 0; // without a branch, so that compilers compare several at once
    for (int i = 0; i < model->count_count; i++) {
        found |= counts[i] == MODEL_NO_INT;
    }
    for (int i = 0; found && i < model->count_count; i++) {
        if (counts[i] == MODEL_NO_INT) {
            if (event->reason != NULL) {
                (void)snprintf(event->reason, event->reason_size, "%s is beyond %d",
                               model->count[i].name, INT_MAX);
            }
            return STATUS_NOT_FINITE;
        }
    }
    return STATUS_OK;
}

/* Assigns what an event or a sampler does, or the start (-1). Returns STATUS_NOT_FINITE, with the
 * reason and with the values before, if a state or discrete variable would not be finite. */
static enum status assign(const struct call *call, int number, const struct event *event) {
    const struct relations *model = call->model;
    const struct assignment *refused = NULL;
    const enum status status = check_defined(call, number, event);
    if (status != STATUS_OK) {
        return status;
    }
    for (int i = 0; i < model->assignment_count; i++) {
        const struct assignment *own = &model->assignment[i];
        call->room.assigned[i] = *(double *)(void *)((char *)call->values + own->offset);
    }
    int *counts = call->segments + model->segment_count;
    const size_t counts_size = (size_t)model->count_count * sizeof *counts;
    memcpy(call->room.counted, counts, counts_size);
    if (number >= 0) {
        model->change(call->values, call->t, relations_later(call->t, call->error), number,
                      call->du, call->room.gradients.shift, call->room.tolerance);
    } else if (model->start != NULL) {
        model->start(call->values);
    }
    for (int i = model->assignment_count - 1; i >= 0; i--) {
        const struct assignment *own = &model->assignment[i];
        const double value = *(double *)(void *)((char *)call->values + own->offset);
        refused = own->event == number && !isfinite(value) ? own : refused;
    }
    for (int i = 0; refused != NULL && i < model->assignment_count; i++) {
        const struct assignment *own = &model->assignment[i];
        *(double *)(void *)((char *)call->values + own->offset) = call->room.assigned[i];
    }
    if (refused == NULL) {
        return check_counts(call, event);
    }
    memcpy(counts, call->room.counted, counts_size);
    return refuse(call, event, refused);
}

/* Sets the tolerance of states that have jumped: 0, or a few roundings of what was assigned.
 * Without those a state that is put onto its limit, a last digit beyond, would meet it again. */
static void allow_rounding(const struct call *call, bool is_allowed) {
    const double *x = states_in(call->model, call->values);
    double *tolerance = call->room.tolerance;
    for (int i = 0; i < call->model->state_count; i++) {
        const double rounding = 8.0 * DBL_EPSILON * fabs(x[i]);
        if (!(tolerance[i] > rounding)) { // others are larger; NaN is no error
            tolerance[i] = is_allowed ? rounding : 0.0;
        }
    }
}

/* Updates all modes after a change of values; call->room.before: the relations before it. Returns
 * true if some have changed. */
static bool follow_change(const struct call *call) {
    update_timed_modes(call);
    bool changes = modes_settle(call);
    allow_rounding(call, true);
    modes_switch_fallen(call);
    allow_rounding(call, false);
    changes |= modes_settle(call);
    for (int k = 0; k < call->relation_count; k++) {
        changes |= call->room.turned[k] != 0;
    }
    modes_clear_turned(call);
    return changes;
}

/* Performs an event or a sampler, and updates all modes. */
static enum status perform(const struct call *call, int number, const struct event *event) {
    modes_compare(call, call->room.tolerance, call->room.before);
    const enum status status = assign(call, number, event);
    if (status != STATUS_OK) {
        return status;
    }
    (void)follow_change(call);
    if (call->model->gradients != NULL) {
        call->room.gradients.departure->jumps = true;
    }
    return STATUS_OK;
}

bool relations_is_due(const struct call *call, int sampler, double t, double *tick) {
    const double *discrete = discrete_of(call);
    /* of the sum that is the time of the tick: its parts may cancel */
    const double size = fabs(discrete[0]) + fabs(call->room.offset[sampler]) +
                        discrete[1 + sampler] * call->room.every[sampler];
    *tick = relations_tick_time(call->model, call->room, call->values, sampler);
    return *tick <= t + 4.0 * DBL_EPSILON * size;
}

/* Writes the time of the event. A tick's time is exact: an event that was located beside it happens
 * there, and so do other time events that differ from it by rounding. */
static void set_time(struct call *call, const struct event *event) {
    const struct relations *model = call->model;
    const double start = model->sampler_count > 0 ? discrete_of(call)[0] : call->t;
    if (event->is_timed) {
        call->t = fmax(call->t, relations_next_time(model, call->room, call->values));
    }
    double period = 0.0; // of a tick that happens now
    const double now = call->t;
    model->write_periods(call->values, call->room.every, call->room.offset);
    for (int i = 0; i < model->sampler_count; i++) {
        double tick;
        if (relations_is_due(call, i, now, &tick)) {
            call->t = fmax(call->t, tick);
            period = call->room.every[i];
        }
    }
    const bool is_at_tick = period > 0.0;
    const double size = fmax(fabs(call->t), fabs(start));
    call->error =
        (is_at_tick || event->is_timed ? RELATIONS_TIME_ROUNDING : MODES_TIME_ERROR) * size;
    call->error = fmax(call->error, part_of_period * period); // at t = 0, too
    call->passed = is_at_tick ? call->t + call->error : call->t;
}

/* Runs the samplers whose time has come, in their order. */
static enum status run_samplers(const struct call *call, const struct event *event) {
    const struct relations *model = call->model;
    double *discrete = discrete_of(call);
    model->write_periods(call->values, call->room.every, call->room.offset);
    for (int i = 0; i < model->sampler_count; i++) {
        double tick;
        if (relations_is_due(call, i, call->t, &tick)) {
            const enum status status = perform(call, model->event_count + i, event);
            if (status != STATUS_OK) {
                return status;
            }
            discrete[1 + i] += 1.0;
        }
    }
    return STATUS_OK;
}

/* Adds the name of an event to the reason. */
static void add_name(const struct event *event, const char *name) {
    if (event->reason != NULL) {
        const size_t length = strlen(event->reason);
        (void)snprintf(event->reason + length, event->reason_size - length, "%s%s",
                       length > 0 && *name != ':' ? ", " : "", name);
    }
}

/* Finds the events whose conditions hold; the others may fire again. */
static enum status look_at_conditions(const struct call *call, const struct event *event) {
    const int *due = call->room.due;
    call->model->find_due(call->values, call->t, call->room.due);
    for (int k = 0; k < call->model->event_count; k++) {
        call->active[k] = call->active[k] && due[k];
    }
    return check_defined(call, RELATIONS_CONDITIONS, event);
}

/* Runs the events that have become due, in their order. *fires: false if there was none. is_last:
 * the reason gets their names. */
static enum status run_due_events(const struct call *call, const struct event *event, bool is_last,
                                  bool *fires) {
    const struct relations *model = call->model;
    enum status status = look_at_conditions(call, event);
    *fires = false;
    for (int i = 0; status == STATUS_OK && i < model->event_count; i++) {
        if (call->room.due[i] && !call->active[i]) {
            status = perform(call, i, event);
            call->active[i] = 1;
            *fires = true;
            if (model->ends != NULL && model->ends[i] && call->active[model->event_count] == 0) {
                call->active[model->event_count] = 1 + i;
            }
            if (status == STATUS_OK && is_last) {
                add_name(event, model->change_names[i]);
            }
            status = status == STATUS_OK ? look_at_conditions(call, event) : status;
        }
    }
    return status;
}

/* True if a relation at its limit is about to pass it, so that it switches together with another
 * relation of the same limit. It need not be read yet. */
static bool joins(const struct compared *compared, int holds) {
    return modes_near(compared) && modes_slope(compared, holds) < 0.0;
}

/* Puts relations in circles back over their limits, if distances in the modes behind them have
 * taken all of them back: an unknown may meet its limit within its error before the states do. */
static void insist(const struct call *call) {
    const int count = call->relation_count;
    int *turned = call->room.turned;
    bool is_back = call->model->is_circular != NULL;
    bool is_any = false;
    for (int k = 0; k < count; k++) {
        const bool has_passed = (turned[k] & (RISEN | FALLEN)) != 0;
        is_any |= has_passed && is_back && call->model->is_circular[k];
        is_back &= !has_passed || call->holds[k] != ((turned[k] & RISEN) != 0);
    }
    for (int k = 0; is_any && is_back && k < count; k++) {
        if (turned[k] != 0) {
            call->holds[k] = (turned[k] & RISEN) != 0;
            turned[k] = TURNED;
        }
    }
    if (is_any && is_back) {
        (void)modes_settle(call);
    }
    modes_clear_turned(call);
}

static void pass(const struct call *call, const struct event *event) {
    const struct relations *model = call->model;
    const struct relations_room room = call->room;
    modes_compare(call, room.tolerance, room.compared);
    for (int k = 0; k < call->relation_count; k++) {
        const struct relation *relation = &model->relation[k];
        if (!relation->is_timed && event->triggered != NULL) {
            // if a state is at its limit within its error, its indicator may only seem to fall
            const double slope = modes_slope(&room.compared[k], call->holds[k]);
            const bool falls =
                event->triggered[relation->indicator] && !(event->du_is_known && slope > 0.0);
            const bool passes = falls || joins(&room.compared[k], call->holds[k]);
            room.turned[k] |= !passes ? 0 : call->holds[k] ? FALLEN : RISEN;
        }
    }
    if (model->gradients != NULL) {
        model->gradients->depart(call, event);
    }
    update_timed_modes(call);
    for (int k = 0; k < call->relation_count; k++) {
        call->holds[k] ^= (room.turned[k] & (RISEN | FALLEN)) != 0;
    }
    if (event->triggered != NULL) {
        (void)modes_settle(call);
        insist(call);
    } else {
        (void)modes_update(call, false);
    }
}

/* Returns true if a sampler with this period and offset (s) can tick from the time of the event on,
 * or never does since its period is 0; otherwise writes the reason. */
static bool can_tick(const struct relations *model, int sampler, double every, double offset,
                     const struct event *event) {
    const double shortest = fmax(event_shortest_period(event->t), shortest_period);
    const bool is_possible = every == 0.0 || (every >= shortest && isfinite(every));
    if (is_possible && offset >= 0.0 && isfinite(offset)) {
        return true;
    }
    if (event->reason != NULL && !(offset >= 0.0 && isfinite(offset))) {
        (void)snprintf(event->reason, event->reason_size,
                       "%s: offset = %g s is refused: it must be 0 or more",
                       model->change_names[model->event_count + sampler], offset);
    } else if (event->reason != NULL) {
        (void)snprintf(event->reason, event->reason_size,
                       "%s = %g s is refused: at a start time of %g s it must be %g s or more, "
                       "or 0",
                       model->every_names[sampler], every, event->t, shortest);
    }
    return false;
}

/* Starts the samplers at the time of the event. Returns STATUS_INVALID_PARAMETERS, with the reason,
 * if one of them cannot tick. */
static enum status start_samplers(const struct call *call, const struct event *event) {
    const struct relations *model = call->model;
    model->write_periods(call->values, call->room.every, call->room.offset);
    for (int i = 0; i < model->sampler_count; i++) {
        if (!can_tick(model, i, call->room.every[i], call->room.offset[i], event)) {
            return STATUS_INVALID_PARAMETERS;
        }
    }
    if (model->sampler_count > 0) {
        discrete_of(call)[0] = event->t;
    }
    return STATUS_OK;
}

/* Decides contacts, and relations with them, until none of them changes. */
static enum status follow_contacts(const struct call *call, const struct event *event,
                                   bool is_first, bool is_start, bool *changes) {
    enum { MOST_ROUNDS = 20 };
    const struct relations *model = call->model;
    const bool is_read = call->relation_count > 0 || model->segment_count > 0;
    enum status status = STATUS_OK;
    bool differs = model->contacts != NULL;
    for (int count = 0; differs && status == STATUS_OK && count < MOST_ROUNDS; count++) {
        differs = false;
        if (is_read) {
            modes_compare(call, call->room.tolerance, call->room.before);
        }
        status = model->contacts->update(call, event, is_first && count == 0, is_start, &differs);
        *changes |= differs;
        differs = differs && status == STATUS_OK && is_read && follow_change(call);
    }
    if (differs && status == STATUS_OK) {
        if (event != NULL && event->reason != NULL) {
            (void)snprintf(event->reason, event->reason_size,
                           "friction or stops and conditions change each other without end");
        }
        return STATUS_INTERNAL;
    }
    return status;
}

const void *relations_followed(const struct relations *model, struct relations_room room,
                               const void *values, double t, void *copy) {
    const int is_begun = *relations_modes(model, values);
    if (is_begun && !model->has_inputs) {
        return values;
    }
    memcpy(copy, values, model->values_size);
    if (!is_begun && model->start != NULL) {
        model->start(copy);
    }
    const struct call call = modes_call(model, room, copy, t, room.zeros, NULL);
    if (is_begun) {
        modes_follow_inputs(&call);
    } else {
        modes_begin(&call);
        (void)follow_contacts(&call, NULL, false, false, &(bool){false});
    }
    return copy;
}

enum status relations_update(const struct relations *model, struct relations_room room,
                             void *values, const struct event *event) {
    struct call call = modes_call(model, room, values, event->t, event->du, event->largest_inputs);
    const double *x = states_in(model, values);
    double *tolerance = room.tolerance;
    const int was_begun = *call.is_begun;
    if (!was_begun) {
        enum status status = assign(&call, -1, event);
        if (status == STATUS_OK) {
            status = start_samplers(&call, event);
        }
        if (status != STATUS_OK) {
            return status;
        }
        modes_begin(&call);
        *call.is_begun = 1;
    }
    enum status status = STATUS_OK;
    set_time(&call, event);
    for (int i = 0; i < model->state_count; i++) {
        const double located = location_error * (model->nominal[i] + fabs(x[i]));
        tolerance[i] = fmax(event->tolerance[i], located);
    }
    if (was_begun) {
        pass(&call, event);
    } else if (model->sampler_count > 0) {
        (void)modes_settle(&call);
    }
    bool changes = false;
    if (!was_begun) {
        status = follow_contacts(&call, event, true, true, &changes);
    }
    status = status == STATUS_OK ? run_samplers(&call, event) : status;
    bool fires = true;
    for (int count = 0; status == STATUS_OK && fires && count <= event->max_events; count++) {
        status = run_due_events(&call, event, count == event->max_events, &fires);
        if (status == STATUS_OK && (was_begun || fires)) {
            changes = false;
            status = follow_contacts(&call, event, was_begun && count == 0, false, &changes);
            fires |= changes && model->event_count > 0;
        }
    }
    if (status == STATUS_OK && model->gradients != NULL) {
        model->gradients->arrive(&call, event, !was_begun);
    }
    const int wrong = status == STATUS_OK && !fires ? modes_contradiction(&call) : -1;
    if (wrong >= 0) {
        if (event->reason != NULL) {
            (void)snprintf(
                event->reason, event->reason_size,
                "%.150s contradicts itself: what follows from it makes it false where it holds, "
                "and true where it does not",
                model->names[wrong]);
        }
        return STATUS_INTERNAL;
    }
    if (status == STATUS_OK && fires) {
        char more[100];
        (void)snprintf(more, sizeof more, ": true again, more than max_events = %d times at once",
                       event->max_events);
        add_name(event, more);
        status = STATUS_INTERNAL;
    }
    return status;
}
