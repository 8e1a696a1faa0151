#include "relations.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

/* Relative distance of a state from its limit where its event may be located; and of the time. */
static const double location_error = 1e-11;
static const double time_error = 1e-12;
static const double rest_time = 1e-3;        // s: a relation at rest stays within its noise so long
static const double shortest_period = 1e-12; // s, of samplers
static const double part_of_period = 0x1p-40; // that counts as rounding

/* Arguments of all functions during one event: a model, its values, and memory. */
struct call {
    const struct relations *model;
    struct relations_room room;
    void *values;
    int *is_begun, *holds, *active, *segments; /* parts of its modes */
    double t;                                  /* s */
    double error;                              /* of t, s */
    double passed;                /* s: earlier time events, and those at this time, are past */
    const double *du;             /* derivative of each input by the time */
    const double *largest_inputs; /* as in struct event */
};

static struct call call_of(const struct relations *model, struct relations_room room, void *values,
                           double t, const double du[], const double largest_inputs[]) {
    int *modes = (int *)(void *)((char *)values + model->modes.offset);
    int *holds = modes + 1;
    int *active = holds + model->relation_count;
    return (struct call){
        model, room, values, modes, holds,         active, active + model->event_count + 1,
        t,     0.0,  t,      du,    largest_inputs};
}

/* Compares all relations. state_errors: how far from its limit each state may have been located, in
 * its unit. */
static void compare(const struct call *call, const double state_errors[],
                    struct compared compared[]) {
    const bool inputs_move = call->largest_inputs != NULL; // those that do not are exact
    const double *largest = inputs_move ? call->largest_inputs : call->room.zeros;
    const double inputs = inputs_move ? time_error : 0.0;
    const struct given given = {state_errors, call->error, inputs, largest, call->du};
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

/* Moves a segment whose value has left it: by one, or to where the value is if that is farther.
 * Returns true if it has moved. */
static bool update_segment(const struct call *call, int i, bool is_exact) {
    const struct segment *segment = &call->model->segment[i];
    int *number = &call->segments[i];
    const bool is_above = call->holds[segment->high] != 0;
    const bool is_below = call->holds[segment->low] == 0;
    if (!is_above && !is_below) {
        return false;
    }
    const int before = *number;
    int found = call->room.segment[i];
    if (!is_exact && is_above && found <= before) {
        found = before + 1;
    } else if (!is_exact && !is_above && found >= before) {
        found = before - 1;
    }
    *number = found < segment->first  ? segment->first
              : found < segment->last ? found
                                      : segment->last;
    call->holds[segment->low] = 1;
    call->holds[segment->high] = 0;
    return *number != before;
}

/* Writes to call->room.segment where the values of all segments are. */
static void locate_segments(const struct call *call) {
    if (call->model->segment_count > 0) {
        call->model->locate(call->values, call->t, call->room.segment);
    }
}

static bool update_segments(const struct call *call, bool is_exact) {
    const struct relations *model = call->model;
    bool changes = false;
    locate_segments(call);
    for (int i = 0; i < model->segment_count; i++) {
        changes |= update_segment(call, i, is_exact);
    }
    return changes;
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
    const bool moves = update_segments(call, is_exact);
    return changes || moves;
}

/* Updates the mode of the first relation whose distance contradicts it. Returns false if there is
 * none. */
static bool update_first_mode(const struct call *call, bool is_exact) {
    const struct compared *compared = call->room.compared;
    compare(call, call->room.tolerance, call->room.compared);
    for (int k = 0; k < call->model->relation_count; k++) {
        const int holds = holds_at(&call->model->relation[k], compared[k].distance);
        const bool follows = is_exact || (is_sure(&compared[k]) && !call->room.turned[k]);
        if (follows && !call->model->relation[k].is_timed && call->holds[k] != holds) {
            call->holds[k] = holds;
            return true;
        }
    }
    return false;
}

/* Rounds for relations in circles, for each of which there may be several. */
enum { ROUNDS_IN_CIRCLES = 20 };

/* Repeats update_modes until no mode changes. Without circles each round decides at least one
 * relation more for good. In circles, where all modes at once find no end, the first wrong one
 * changes alone: Murty's rule for linear complementarity. */
static void update_modes_until_stable(const struct call *call, bool is_exact) {
    const int relations = call->model->relation_count;
    bool changes = true;
    for (int count = 0; changes && count < relations; count++) {
        changes = update_modes(call, is_exact);
    }
    const int rounds =
        call->model->is_circular != NULL && changes ? ROUNDS_IN_CIRCLES * relations : 0;
    for (int count = 0; changes && count < rounds; count++) {
        changes = update_first_mode(call, is_exact);
    }
}

/* True if the distance of a relation contradicts its mode or, at the limit, will at once. */
static bool is_contradicted(const struct call *call, int k) {
    const struct compared *compared = &call->room.compared[k];
    compare(call, call->room.tolerance, call->room.compared);
    const double slope = call->holds[k] ? compared->slope : -compared->slope;
    const int holds = holds_at(&call->model->relation[k], compared->distance);
    return is_near(compared) ? slope < 0.0 : is_sure(compared) && holds != call->holds[k];
}

/* Returns a relation in a circle that is contradicted whether it holds or not; -1 if there is none.
 */
static int contradiction(const struct call *call) {
    const bool *is_circular = call->model->is_circular;
    for (int k = 0; is_circular != NULL && k < call->model->relation_count; k++) {
        if (!is_circular[k] || !is_contradicted(call, k)) {
            continue;
        }
        call->holds[k] = !call->holds[k];
        const bool is_wrong = is_contradicted(call, k);
        call->holds[k] = !call->holds[k];
        if (is_wrong && call->room.compared[k].used) {
            return k;
        }
    }
    return -1;
}

/* Puts relations that the time takes over their limits on their later sides. Returns true if some
 * have changed. */
static bool pass_by_time(const struct call *call) {
    const struct relation *relation = call->model->relation;
    const struct compared *compared = call->room.compared;
    bool changes = false;
    bool is_any = false;
    for (int k = 0; k < call->model->relation_count; k++) {
        is_any |= relation[k].is_of_time && !relation[k].is_timed;
    }
    if (!is_any) {
        return false;
    }
    compare(call, call->room.zeros, call->room.compared);
    for (int k = 0; k < call->model->relation_count; k++) {
        const bool passes = relation[k].is_of_time && !relation[k].is_timed &&
                            is_near(&compared[k]) && compared[k].slope != 0.0;
        const int holds = compared[k].slope > 0.0;
        changes |= passes && call->holds[k] != holds;
        call->holds[k] = passes ? holds : call->holds[k];
    }
    return changes;
}

/* Updates all modes at an event. Where one value jumps, others may come to their limits. */
static void settle(const struct call *call) {
    update_modes_until_stable(call, false);
    for (int count = 0; count < call->model->relation_count && pass_by_time(call); count++) {
        update_modes_until_stable(call, false);
    }
}

/* Writes the modes that follow from the values, whatever they were before. Returns true if some
 * have changed. */
static bool set_modes_from_values(const struct call *call, bool only_of_inputs) {
    const struct relations *model = call->model;
    const struct compared *compared = call->room.compared;
    bool changes = false;
    locate_segments(call);
    for (int i = 0; i < model->segment_count; i++) {
        if (model->segment[i].is_of_inputs || !only_of_inputs) {
            changes |= call->segments[i] != call->room.segment[i];
            call->segments[i] = call->room.segment[i];
        }
    }
    compare(call, call->room.zeros, call->room.compared);
    for (int k = 0; k < model->relation_count; k++) {
        if (model->relation[k].is_of_inputs || !only_of_inputs) {
            const int holds = holds_at(&model->relation[k], compared[k].distance);
            changes |= call->holds[k] != holds;
            call->holds[k] = holds;
        }
    }
    return changes;
}

/* Writes the modes that follow from inputs only, each after those that its relation reads. */
static void follow_inputs(const struct call *call) {
    for (int count = 0; set_modes_from_values(call, true) && count < call->model->relation_count;
         count++) {
    }
}

static void set_first_modes(const struct call *call) {
    set_modes_from_values(call, false);
    update_modes_until_stable(call, true);
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
    const struct call call = call_of(model, room, copy, t, room.zeros, NULL);
    if (is_begun) {
        follow_inputs(&call);
    } else {
        set_first_modes(&call);
    }
    return copy;
}

static const double *states_in(const struct relations *model, const void *values) {
    return (const double *)(const void *)((const char *)values + model->states);
}

static double *discrete_of(const struct call *call) {
    return (double *)(void *)((char *)call->values + call->model->discrete.offset);
}

/* Returns the slope of the distance with the sign of the mode. */
static double signed_slope(const struct compared *compared, int holds) {
    return holds ? compared->slope : -compared->slope;
}

/* Switches relations after an event has changed values: a relation at its limit that now falls
 * switches, or its next event would be due at once; a relation that the event has placed at its
 * limit, at rest, holds if it includes zero, as does one that nothing has read before. The motion
 * of inputs may not be known, but it is part of the slopes before and after the change.
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
        const bool is_new = !before[k].used || signed_slope(&before[k], call->holds[k]) > 0.0;
        const bool rests = is_new && fabs(after[k].slope) * rest_time <= after[k].noise;
        if (!model->relation[k].is_timed && is_near(&after[k]) && rests) {
            call->room.turned[k] = 1;
            call->holds[k] = model->relation[k].includes_zero;
        }
    }
}

/* Updates the modes of timed relations. Their times may follow from discrete variables. */
static void update_timed_modes(const struct call *call) {
    const struct relations *model = call->model;
    model->write_times(call->values, call->room.times);
    for (int k = 0; k < model->relation_count; k++) {
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
    for (int i = 0; i < model->assignment_count; i++) {
        const struct assignment *own = &model->assignment[i];
        call->room.assigned[i] = *(double *)(void *)((char *)call->values + own->offset);
    }
    if (number >= 0) {
        model->change(call->values, call->t, relations_later(call->t, call->error), number,
                      call->room.tolerance);
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
    return refused != NULL ? refuse(call, event, refused) : check_counts(call, event);
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

/* Performs an event or a sampler, and updates all modes. */
static enum status perform(const struct call *call, int number, const struct event *event) {
    const struct relations *model = call->model;
    compare(call, call->room.tolerance, call->room.before);
    const enum status status = assign(call, number, event);
    if (status != STATUS_OK) {
        return status;
    }
    update_timed_modes(call);
    settle(call);
    allow_rounding(call, true);
    switch_fallen(call);
    allow_rounding(call, false);
    settle(call);
    memset(call->room.turned, 0, (size_t)model->relation_count * sizeof *call->room.turned);
    return STATUS_OK;
}

/* True if the next tick of a sampler, at the time *tick, is at the time t (s) or before. Times that
 * differ only by rounding, such as 3 0.1 and 1 0.3, are one instant. */
static bool is_due(const struct call *call, int sampler, double t, double *tick) {
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
        if (is_due(call, i, now, &tick)) {
            call->t = fmax(call->t, tick);
            period = call->room.every[i];
        }
    }
    const bool is_at_tick = period > 0.0;
    const double size = fmax(fabs(call->t), fabs(start));
    call->error = (is_at_tick || event->is_timed ? RELATIONS_TIME_ROUNDING : time_error) * size;
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
        if (is_due(call, i, call->t, &tick)) {
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
static void look_at_conditions(const struct call *call) {
    const int *due = call->room.due;
    call->model->find_due(call->values, call->t, call->room.due);
    for (int k = 0; k < call->model->event_count; k++) {
        call->active[k] = call->active[k] && due[k];
    }
}

/* Runs the events that have become due, in their order. *fires: false if there was none. is_last:
 * the reason gets their names. */
static enum status run_due_events(const struct call *call, const struct event *event, bool is_last,
                                  bool *fires) {
    const struct relations *model = call->model;
    enum status status = STATUS_OK;
    *fires = false;
    look_at_conditions(call);
    for (int i = 0; status == STATUS_OK && i < model->event_count; i++) {
        if (call->room.due[i] && !call->active[i]) {
            status = perform(call, i, event);
            call->active[i] = 1;
            *fires = true;
            if (status == STATUS_OK && is_last) {
                add_name(event, model->change_names[i]);
            }
            look_at_conditions(call);
        }
    }
    return status;
}

/* True if a relation at its limit is about to pass it, so that it switches together with another
 * relation of the same limit. It need not be read yet. */
static bool joins(const struct compared *compared, int holds) {
    return is_near(compared) && signed_slope(compared, holds) < 0.0;
}

static void pass(const struct call *call, const struct event *event) {
    const struct relations *model = call->model;
    const struct relations_room room = call->room;
    compare(call, room.tolerance, room.compared);
    update_timed_modes(call);
    for (int k = 0; k < model->relation_count; k++) {
        const struct relation *relation = &model->relation[k];
        if (!relation->is_timed && event->triggered != NULL) {
            // if a state is at its limit within its error, its indicator may only seem to fall
            const double slope = signed_slope(&room.compared[k], call->holds[k]);
            const bool falls =
                event->triggered[relation->indicator] && !(event->du_is_known && slope > 0.0);
            call->holds[k] ^= falls || joins(&room.compared[k], call->holds[k]);
        }
    }
    if (event->triggered != NULL) {
        settle(call);
    } else {
        update_modes_until_stable(call, false);
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

enum status relations_update(const struct relations *model, struct relations_room room,
                             void *values, const struct event *event) {
    struct call call = call_of(model, room, values, event->t, event->du, event->largest_inputs);
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
        set_first_modes(&call);
        *call.is_begun = 1;
    }
    set_time(&call, event);
    for (int i = 0; i < model->state_count; i++) {
        const double located = location_error * (model->nominal[i] + fabs(x[i]));
        tolerance[i] = fmax(event->tolerance[i], located);
    }
    if (was_begun) {
        pass(&call, event);
    } else if (model->sampler_count > 0) {
        settle(&call);
    }
    enum status status = run_samplers(&call, event);
    bool fires = true;
    for (int count = 0; status == STATUS_OK && fires && count <= event->max_events; count++) {
        status = run_due_events(&call, event, count == event->max_events, &fires);
    }
    const int wrong = status == STATUS_OK && !fires ? contradiction(&call) : -1;
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
