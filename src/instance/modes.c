#include "modes.h"

#include "failures.h"
#include "state.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

/* Returns the nominal value of a state, in its unit. */
static double nominal_of(const struct instance *instance, size_t state) {
    const double relative = instance->state.own.effective_relative_tolerance;
    return instance->absolute_tolerances[state] / (INSTANCE_ABSOLUTE_FRACTION * relative);
}

/* Writes how far each state may be from its limit when an integrator outside stops, in its unit. */
static void write_location_errors(const struct instance *instance, double errors[]) {
    const struct range states = instance->model->states;
    const double *x = doubles_of(instance->memory.values, states);
    for (size_t i = 0; i < count_of(states); i++) {
        errors[i] = 2e-10 * (nominal_of(instance, i) + fabs(x[i]));
    }
}

/* After an event an indicator that rises again from its band is above 0 at once, so that importers
 * see no second event: the bands are this much wider there, and as before after this time, s. */
static const double widening = 63.0;
static const double widening_time = 1e-3;

/* Returns how much wider the bands of indicators are a time after an event, s. */
static double widened(double since) {
    const double ratio = since / widening_time;
    return 1.0 + widening / (1.0 + ratio * ratio);
}

/* Writes the error of each state at an event: the integrator's tolerance or, outside, twice the
 * error of the location, since indicators fall to 0 beyond their roots. since: time from the event
 * before, s. */
static void write_tolerances(struct instance *instance, double since) {
    const struct range states = instance->model->states;
    const double *x = doubles_of(instance->memory.values, states);
    const bool is_located_outside =
        instance->is_integrated_outside && instance->model->events->errors != NULL;
    double *tolerances = instance->event_tolerances;
    const double relative = instance->state.own.effective_relative_tolerance;
    if (is_located_outside) {
        write_location_errors(instance, tolerances);
    }
    for (size_t i = 0; i < count_of(states); i++) {
        const double allowed = instance->absolute_tolerances[i] + relative * fabs(x[i]);
        tolerances[i] =
            is_located_outside ? fmax(allowed, 2.0 * widened(since) * tolerances[i]) : allowed;
    }
}

/* Bouncing ends below this part of the requested tolerance, with every method. */
static const double rest_fraction = 0.1;

/* True if triggered, as in struct instance, says that a time event has come. */
static bool is_timed(const struct instance *instance, const bool *triggered) {
    return triggered != NULL && triggered[instance->model->events->indicator_count];
}

/* Returns STATUS_OK if the next time event is later: time events must not follow each other at the
 * same time without end. */
static enum status check_next_time(const struct instance *instance, double passed) {
    const double next = instance_next_time(instance);
    if (next > passed) {
        return STATUS_OK;
    }
    message_write(&instance->sink, STATUS_INTERNAL,
                  "a time event at t = %.17g is followed by one at t = %.17g", passed, next);
    return STATUS_INTERNAL;
}

static enum status update(struct instance *instance, const bool *triggered, double since) {
    const struct model_events *events = instance->model->events;
    instance->indicators_are_active = false;
    write_tolerances(instance, since);
    const struct polynomial *inputs = instance->memory.current_inputs;
    const size_t input_count = count_of(instance->model->inputs);
    for (size_t i = 0; i < input_count; i++) {
        instance->du[i] = inputs[i].d[1];
    }
    char reason[300];
    char note[300];
    const char *text = NULL;
    reason[0] = note[0] = '\0';
    const struct event event = {
        .t = instance->state.time.s,
        .triggered = triggered,
        .is_timed = is_timed(instance, triggered),
        .du = instance->du,
        .largest_inputs = events->errors != NULL && polynomials_move(inputs, input_count)
                              ? instance->memory.largest_inputs
                              : NULL,
        .du_is_known = !instance->is_integrated_outside,
        .tolerance = instance->event_tolerances,
        .rest = rest_fraction * instance_requested_tolerance(instance, &instance->state) /
                instance->state.own.effective_relative_tolerance,
        .max_events = instance->state.own.max_events,
        .text = &text,
        .reason = reason,
        .reason_size = sizeof reason,
        .note = note,
        .note_size = sizeof note,
    };
    const double passed = event.is_timed ? instance_next_time(instance) : -INFINITY;
    const bool had_ended = instance_explain_end(instance, NULL, 0);
    const enum status status = events->update(instance->memory.values, &event);
    if (note[0] != '\0') {
        message_write(&instance->sink, STATUS_INEXACT_GRADIENTS,
                      "from t = %.17g on gradients are not exact: %s", event.t, note);
    }
    char end[1024];
    if (status == STATUS_OK && !had_ended && instance_explain_end(instance, end, sizeof end)) {
        message_write(&instance->sink, STATUS_ENDED, "the simulation ends at t = %.17g: %s",
                      event.t, end);
    }
    if (status == STATUS_OK && event.is_timed) {
        return check_next_time(instance, passed);
    }
    if (status != STATUS_OK && instance->sink.write != NULL) {
        struct explanation why = {.length = 0};
        if (text != NULL) {
            instance_explain_text(instance, text, &why);
        }
        message_write(&instance->sink, status, "at t = %.17g: %s%s", event.t,
                      reason[0] != '\0' ? reason : status_text(status), why.text);
    }
    return status;
}

enum status instance_update_modes(struct instance *instance, const bool *triggered) {
    const struct model_events *events = instance->model->events;
    if (events == NULL) {
        return STATUS_OK;
    }
    instance->outputs_are_valid = false;
    if (triggered == NULL && events->moves_on != NULL &&
        events->moves_on(instance->memory.values)) {
        return STATUS_OK;
    }
    return update(instance, triggered, INFINITY);
}

enum status instance_check_conditions(struct instance *instance) {
    const struct model_events *events = instance->model->events;
    if (events == NULL || events->undefined == NULL) {
        return STATUS_OK;
    }
    const double t = instance->state.time.s;
    const char *undefined = events->undefined(instance->memory.values, t);
    if (undefined == NULL) {
        return STATUS_OK;
    }
    struct explanation why = {.length = 0};
    instance_explain_text(instance, strchr(undefined, '=') + 1, &why);
    message_write(&instance->sink, STATUS_NOT_FINITE, "at t = %.17g: %.200s has no value%s", t,
                  undefined, why.text);
    return STATUS_NOT_FINITE;
}

/* Counts how often an indicator has fallen in a row; the two limits of a floor have one name. */
static void note_indicator(const char *const names[], const bool triggered[],
                           struct event_counts *in_step) {
    size_t first = 0;
    while (!triggered[first]) {
        first++;
    }
    const bool is_last = strcmp(names[first], names[in_step->last]) == 0;
    in_step->in_a_row = is_last ? in_step->in_a_row + 1 : 1;
    in_step->last = first;
}

static void refuse_state_event(const struct instance *instance, const struct event_counts *counts) {
    char times[60];
    times[0] = '\0';
    if (counts->in_a_row > 1) {
        (void)snprintf(times, sizeof times, ", the same %d times in a row,", counts->in_a_row);
    }
    message_write(&instance->sink, STATUS_TOO_MANY_EVENTS,
                  "the step ended at t = %.17g: %s%s is one event more than max_events = %d%s",
                  instance->state.own.time, instance->model->events->indicator_names[counts->last],
                  times, instance->state.own.max_events,
                  counts->in_a_row > 1 ? ": a mode must hold what stays at its limit" : "");
}

static void refuse_time_event(const struct instance *instance) {
    message_write(&instance->sink, STATUS_TOO_MANY_EVENTS,
                  "the step ended at t = %.17g: a time event is due there, one more than "
                  "max_internal_steps = %d",
                  instance->state.own.time, instance->state.own.max_internal_steps);
}

enum status instance_count_event(struct instance *instance, const bool triggered[],
                                 struct event_counts *in_step) {
    struct instance_values *own = &instance->state.own;
    const bool is_time_event = is_timed(instance, triggered);
    if (is_time_event && in_step->of_time >= own->max_internal_steps) {
        refuse_time_event(instance);
        return STATUS_TOO_MANY_EVENTS;
    }
    if (!is_time_event) {
        note_indicator(instance->model->events->indicator_names, triggered, in_step);
    }
    if (!is_time_event && in_step->of_states >= own->max_events) {
        refuse_state_event(instance, in_step);
        return STATUS_TOO_MANY_EVENTS;
    }
    *(is_time_event ? &in_step->of_time : &in_step->of_states) += 1;
    own->event_count += own->event_count < INT_MAX ? 1 : 0;
    own->last_event_time = own->time;
    return STATUS_OK;
}

/* ---- The event at which a step has ended ---------------------------------------------------- */

/* Forgets forces that had triggered the event: after a change of inputs or parameters they may no
 * longer do so; states still do. */
static void forget_unhandled_forces(struct instance *instance) {
    const struct model_events *events = instance->model->events;
    if (events->describe != NULL) {
        events->describe(instance->memory.values, instance->indicators);
    }
    for (size_t i = 0; i < events->indicator_count; i++) {
        if (instance->indicators[i].kind == INDICATOR_OF_MODEL) {
            instance->memory.unhandled[i] = false;
        }
    }
}

enum status instance_handle_event(struct instance *instance, struct event_counts *in_step) {
    struct instance_state *state = &instance->state;
    if (state->event_point != EVENT_UNHANDLED) {
        return STATUS_OK;
    }
    const bool is_unchanged = instance_is_unchanged(instance);
    enum status status = instance_count_event(instance, instance->memory.unhandled, in_step);
    if (!is_unchanged) {
        forget_unhandled_forces(instance);
    }
    if (status == STATUS_OK) {
        status = instance_update_modes(instance, instance->memory.unhandled);
    }
    if (status == STATUS_OK) {
        state->event_point = is_unchanged ? EVENT_HANDLED : NO_EVENT;
        memset(instance->memory.unhandled, 0, instance_event_size(instance->model));
    }
    return status;
}

bool instance_is_unchanged(const struct instance *instance) {
    return (instance->state.has_history || instance->state.event_point != NO_EVENT) &&
           !polynomials_move(instance->memory.active_inputs, count_of(instance->model->inputs)) &&
           instance_values_are_active(instance);
}

/* ---- Events for an integrator outside ------------------------------------------------------- */

void instance_note_inputs(struct instance *instance) {
    const double *u = doubles_of(instance->memory.values, instance->model->inputs);
    for (size_t i = 0; i < instance_noted_inputs(instance->model); i++) {
        instance->memory.largest_inputs[i] = fmax(instance->memory.largest_inputs[i], fabs(u[i]));
    }
}

/* Distance from its root at which integrators stop, relative to the size of the indicator. */
static const double near_root = 1e-10;

/* Returns the size of an indicator of a state. */
static double size_of(const struct instance *instance, const struct indicator *indicator) {
    return fabs(indicator->factor) * nominal_of(instance, indicator->state) +
           fabs(indicator->offset);
}

/* Writes the band that is added to each indicator: it falls to 0 only this far beyond its root. A
 * mode may begin at the root, and integrators miss falls that begin at 0. For an indicator of a
 * state the band is far above the rounding of its two parts, the state's nominal value and the
 * offset, and far below the error of integrators. For an indicator of the model it is so large that
 * the force is past its limit wherever an integrator stops, however the inputs move. Writes the
 * kinds of indicators, too. */
static void write_bands(struct instance *instance, double bands[]) {
    const struct model_events *events = instance->model->events;
    const double factor = widened(instance->state.time.s - instance->state.own.last_event_time);
    events->describe(instance->memory.values, instance->indicators);
    if (events->errors != NULL) {
        double *errors = doubles_of(instance->first_derivatives, instance->model->states);
        write_location_errors(instance, errors);
        events->errors(instance->memory.values, instance->state.time.s, errors,
                       instance->memory.largest_inputs, 1e-12, bands);
    }
    for (size_t i = 0; i < events->indicator_count; i++) {
        const struct indicator *indicator = &instance->indicators[i];
        if (indicator->kind == INDICATOR_UNUSED) {
            bands[i] = 0.0;
        } else if (indicator->kind == INDICATOR_OF_STATE) {
            const double nominal = nominal_of(instance, indicator->state);
            bands[i] = 1e-12 * fabs(indicator->factor) * nominal + 1e-14 * fabs(indicator->offset);
        } else if (events->errors == NULL) {
            bands[i] = 2.0 * near_root + 1e-9 * fabs(indicator->offset);
        }
        bands[i] *= events->errors != NULL ? factor : 1.0;
    }
}

void instance_add_bands(struct instance *instance) {
    const struct model_description *description = instance->description;
    if (description->indicator_count == 0) {
        return;
    }
    write_bands(instance, instance->z);
    for (size_t i = 0; i < description->indicator_count; i++) {
        double *z = instance_field(instance, variable_of(description, description->indicators[i]));
        *z += instance->z[i];
    }
}

/* Time over which an indicator's slope is measured, s. */
static const double slope_time = 1e-7;

/* An indicator that has come to 0. */
struct arrival {
    double z;
    double slope; /* 1/s, while the inputs stay */
    double band;
};

/* True if the indicator falls. If a mode has just begun at 0, rounding may let it fall, but not
 * past the band. */
static bool has_state_fallen(const struct arrival *at, double size) {
    const double ahead = at->z + slope_time * at->slope;
    return at->z <= near_root * size && ahead <= at->z && ahead + at->band <= 0.0;
}

/* True if the indicator is below 0 and has fallen. The motion of inputs is not known, so that it
 * may fall though it seems to rise; but an indicator that rises since the last event, from not far
 * below 0, has not fallen. since: s. */
static bool has_model_fallen(const struct arrival *at, double since) {
    const bool has_risen = at->slope > 0.0 && at->z - at->slope * since > -4.0 * at->band;
    return at->z < 0.0 && !has_risen;
}

/* Writes all indicators, and their kinds. */
static enum status evaluate(struct instance *instance, double t, const double x[], double z[]) {
    const struct model *model = instance->model;
    const double *u = doubles_of(instance->memory.values, model->inputs);
    model->events->describe(instance->memory.values, instance->indicators);
    return model->events->indicators(instance->memory.values, t, x, u, z);
}

/* Writes all indicators at `points` points, 3 at most: now and after each slope_time along the
 * motion that begins here while the inputs stay. */
static enum status look_ahead(struct instance *instance, size_t points) {
    const struct model *model = instance->model;
    const double *u = doubles_of(instance->memory.values, model->inputs);
    double *x = doubles_of(instance->first_derivatives, model->states);
    double *dx = doubles_of(instance->second_derivatives, model->dx);
    memcpy(x, instance->memory.values + model->states.offset, model->states.size);
    enum status status = STATUS_OK;
    for (size_t k = 0; k < points && status == STATUS_OK; k++) {
        const double t = instance->state.time.s + (double)k * slope_time;
        status = evaluate(instance, t, x, instance->z + k * model->events->indicator_count);
        if (status == STATUS_OK && k + 1 < points) {
            status = model->right_hand_side(instance->memory.values, t, x, u, dx);
            for (size_t i = 0; i < count_of(model->states); i++) {
                x[i] += slope_time * dx[i];
            }
        }
    }
    return status;
}

/* Writes which indicators have triggered while the inputs stay. */
static enum status find_triggered(struct instance *instance, bool triggered[], bool *is_any) {
    const struct model *model = instance->model;
    const double now = instance->state.time.s;
    const double *z = instance->z;
    const double *z_ahead = z + model->events->indicator_count;
    double *bands = instance->z + 2 * model->events->indicator_count;
    const enum status status = look_ahead(instance, 2);
    if (status == STATUS_OK) {
        write_bands(instance, bands);
    }
    const double since = now - instance->state.own.last_event_time;
    for (size_t i = 0; status == STATUS_OK && i < model->events->indicator_count; i++) {
        const struct indicator *indicator = &instance->indicators[i];
        const struct arrival at = {z[i], (z_ahead[i] - z[i]) / slope_time, bands[i]};
        if (indicator->kind == INDICATOR_OF_STATE) {
            triggered[i] = has_state_fallen(&at, size_of(instance, indicator));
        } else {
            triggered[i] = indicator->kind == INDICATOR_OF_MODEL && has_model_fallen(&at, since);
        }
        *is_any |= triggered[i];
    }
    return status;
}

static bool can_fire(const struct instance *instance) {
    const struct model_events *events = instance->model->events;
    return events != NULL && events->are_possible != NULL &&
           events->are_possible(instance->memory.values);
}

void instance_note_unhandled(struct instance *instance) {
    instance_forget_unhandled(instance);
    bool is_any = false;
    if (can_fire(instance) &&
        find_triggered(instance, instance->memory.unhandled, &is_any) == STATUS_OK && is_any) {
        instance->state.event_point = EVENT_UNHANDLED;
    }
}

void instance_forget_unhandled(struct instance *instance) {
    memset(instance->memory.unhandled, 0, instance_event_size(instance->model));
    instance->state.event_point = NO_EVENT;
}

/* True if some indicator is below 0: otherwise no event can have been missed, as after most steps.
 */
static bool is_any_below(struct instance *instance) {
    const double *x = doubles_of(instance->memory.values, instance->model->states);
    bool is_below = false;
    if (evaluate(instance, instance->state.time.s, x, instance->z) == STATUS_OK) {
        for (size_t i = 0; i < instance->model->events->indicator_count; i++) {
            is_below |= instance->z[i] < 0.0;
        }
    }
    return is_below;
}

bool instance_has_missed_event(struct instance *instance) {
    bool is_any = false;
    if (!can_fire(instance) || instance->model->events->errors == NULL || !is_any_below(instance) ||
        find_triggered(instance, instance->triggered, &is_any) != STATUS_OK) {
        return false;
    }
    // an indicator that is within its band will be seen
    const size_t count = instance->model->events->indicator_count;
    bool is_missed = false;
    for (size_t i = 0; is_any && i < count; i++) {
        is_missed |= instance->triggered[i] && instance->z[i] + instance->z[2 * count + i] < 0.0;
    }
    return is_missed;
}

/* Removes forces from triggered that are not below 0 with the values set now. */
static enum status forget_past_forces(struct instance *instance, bool triggered[]) {
    if (!can_fire(instance)) {
        return STATUS_OK;
    }
    double *x = doubles_of(instance->memory.values, instance->model->states);
    if (evaluate(instance, instance->state.time.s, x, instance->z) != STATUS_OK) {
        return instance_not_finite(instance, "an event indicator");
    }
    for (size_t i = 0; i < instance->model->events->indicator_count; i++) {
        triggered[i] = triggered[i] &&
                       (instance->indicators[i].kind != INDICATOR_OF_MODEL || instance->z[i] < 0.0);
    }
    return STATUS_OK;
}

/* True if an indicator, with these values at three times in equal distances, moves to 0 and turns
 * before it comes there. */
static bool turns_before_zero(double z, double ahead, double far_ahead) {
    const double side = z < 0.0 ? -1.0 : 1.0;
    const double slope = side * (ahead - z);
    const double bend = side * (far_ahead - 2.0 * ahead + z);
    return slope < 0.0 && bend > 0.0 && side * z - slope * slope / (2.0 * bend) >= 0.0;
}

/* Refuses events that cannot be seen. If impacts follow each other ever faster, an event that
 * leaves the state beyond its limit is followed by a flight that ends before it. No further event
 * would come. */
static enum status refuse_unseen_events(struct instance *instance, const bool triggered[]) {
    const size_t count = instance->model->events->indicator_count;
    if (instance->model->events->errors == NULL || look_ahead(instance, 3) != STATUS_OK) {
        return STATUS_OK;
    }
    const double *z = instance->z;
    double *bands = instance->z + count;
    double *turns = instance->z + 2 * count;
    for (size_t i = 0; i < count; i++) {
        turns[i] = turns_before_zero(z[i], z[count + i], z[2 * count + i]);
    }
    write_bands(instance, bands);
    for (size_t i = 0; i < count; i++) { // a state that has jumped far away is not at its limit
        if (triggered[i] && instance->indicators[i].kind != INDICATOR_UNUSED && turns[i] != 0.0 &&
            fabs(z[i]) <= 4.0 * bands[i]) {
            message_write(&instance->sink, STATUS_INTERNAL,
                          "at t = %.17g: events follow each other faster than they can be seen "
                          "from outside: %s; let a mode rest, or set the states onto the limit",
                          instance->state.time.s, instance->model->events->indicator_names[i]);
            return STATUS_INTERNAL;
        }
    }
    return STATUS_OK;
}

enum status instance_update_at_point(struct instance *instance, bool *states_changed) {
    const struct model_events *events = instance->model->events;
    const struct range states = instance->model->states;
    *states_changed = false;
    if (events == NULL) {
        return STATUS_OK;
    }
    bool *triggered = instance->triggered;
    memcpy(triggered, instance->memory.unhandled, instance_event_size(instance->model));
    const double now = instance->state.time.s;
    triggered[events->indicator_count] =
        instance_next_time(instance) - now <= clock_rounding(instance_size_of_times(instance, now));
    const bool is_any =
        instance->state.event_point == EVENT_UNHANDLED || triggered[events->indicator_count];
    instance_forget_unhandled(instance);
    const double since = is_any ? now - instance->state.own.last_event_time : INFINITY;
    enum status status = STATUS_OK;
    if (is_any) {
        struct event_counts none = {0};
        status = instance_count_event(instance, triggered, &none);
    }
    if (status == STATUS_OK) {
        status = forget_past_forces(instance, triggered);
    }
    char *before = instance->second_derivatives + states.offset;
    memcpy(before, instance->memory.values + states.offset, states.size);
    if (status == STATUS_OK) {
        instance->outputs_are_valid = false;
        status = update(instance, is_any ? triggered : NULL, since);
    }
    *states_changed = memcmp(before, instance->memory.values + states.offset, states.size) != 0;
    return status == STATUS_OK && is_any ? refuse_unseen_events(instance, triggered) : status;
}
