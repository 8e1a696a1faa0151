#include "model_modes.h"

#include "fields.h"
#include "settings.h"

#include <limits.h>
#include <math.h>
#include <string.h>

double instance_next_time(const struct instance *instance) {
    const struct model_events *events = instance->model->events;
    return events != NULL && events->next_time != NULL ? events->next_time(instance->memory.values)
                                                       : INFINITY;
}

bool instance_is_at_rest(const struct instance *instance) {
    const struct model_events *events = instance->model->events;
    return events != NULL && events->is_at_rest != NULL &&
           events->is_at_rest(instance->memory.values);
}

const struct indicator *instance_describe_indicators(struct instance *instance) {
    if (!instance_is_searched(instance)) {
        return NULL;
    }
    instance->model->events->describe(instance->memory.restart_values, instance->indicators);
    return instance->indicators;
}

/* What the integrator may miss a state by: away from 0 the relative part is the larger one. */
static void write_tolerances(struct instance *instance) {
    const struct range states = instance->model->states;
    const double *x = doubles_of(instance->memory.values, states);
    for (size_t i = 0; i < count_of(states); i++) {
        instance->tolerances[i] = instance->absolute_tolerances[i] +
                                  instance->state.own.effective_relative_tolerance * fabs(x[i]);
    }
}

/* triggered, of struct instance, says that a time event has come. */
static bool is_timed(const struct instance *instance, const bool *triggered) {
    return triggered != NULL && triggered[instance->model->events->indicator_count];
}

/* Time must get on from one time event to the next. */
static enum status check_next_time(const struct instance *instance, double passed) {
    const double next = instance_next_time(instance);
    if (next > passed) {
        return STATUS_OK;
    }
    message_write(&instance->sink, STATUS_INTERNAL,
                  "a time event at t = %.17g is followed by one at t = %.17g", passed, next);
    return STATUS_INTERNAL;
}

static enum status update(struct instance *instance, const bool *triggered) {
    const struct model_events *events = instance->model->events;
    write_tolerances(instance);
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        instance->du[i] = instance->memory.current_inputs[i].d[1];
    }
    char reason[200];
    reason[0] = '\0';
    const struct event event = {
        .t = instance->state.time.s,
        .triggered = triggered,
        .is_timed = is_timed(instance, triggered),
        .du = instance->du,
        .tolerance = instance->tolerances,
        .reason = reason,
        .reason_size = sizeof reason,
    };
    const double passed = event.is_timed ? instance_next_time(instance) : -INFINITY;
    enum status status = events->update(instance->memory.values, &event);
    if (status == STATUS_OK && event.is_timed) {
        status = check_next_time(instance, passed);
    }
    if (status != STATUS_OK) {
        message_write(&instance->sink, status, "no modes at t = %.17g: %s", event.t,
                      reason[0] != '\0' ? reason : status_text(status));
    }
    return status;
}

enum status instance_update_modes(struct instance *instance, const bool *triggered) {
    if (instance->model->events == NULL) {
        return STATUS_OK;
    }
    instance->outputs_are_valid = false;
    return update(instance, triggered);
}

/* In the unit of an indicator: so far from 0 integrators end at its root. */
static const double near_root = 1e-10;

/* So far beyond its root an indicator falls to 0 for an integrator outside. A mode may begin at the
 * root, and integrators miss falls from 0. Of a state: far above the rounding of its two parts,
 * which are the state's nominal value and the offset; far below what integrators get right. Of the
 * model: how inputs move is not known, so wherever integrators end, the forces have passed. */
static double band_of(const struct instance *instance, const struct indicator *indicator) {
    if (indicator->kind == INDICATOR_UNUSED) {
        return 0.0;
    }
    if (indicator->kind == INDICATOR_OF_MODEL) {
        return 2.0 * near_root + 1e-9 * fabs(indicator->offset);
    }
    const double relative = instance->state.own.effective_relative_tolerance;
    const double nominal =
        instance->absolute_tolerances[indicator->state] / (INSTANCE_ABSOLUTE_FRACTION * relative);
    return 1e-12 * fabs(indicator->factor) * nominal + 1e-14 * fabs(indicator->offset);
}

void instance_add_bands(struct instance *instance) {
    const struct model_description *description = instance->description;
    if (description->indicator_count == 0) {
        return;
    }
    instance->model->events->describe(instance->memory.values, instance->indicators);
    for (size_t i = 0; i < description->indicator_count; i++) {
        double *z = instance_field(instance, variable_of(description, description->indicators[i]));
        *z += band_of(instance, &instance->indicators[i]);
    }
}

/* s: over this time the slope of an indicator is taken. */
static const double slope_time = 1e-7;

/* Indicator i has come to 0 and does not rise; z_ahead: after slope_time. Where a mode has just
 * begun at 0, rounding may let it fall, but not past the band. */
static bool has_triggered(const struct instance *instance, size_t i, double z, double z_ahead) {
    const struct indicator *indicator = &instance->indicators[i];
    if (indicator->kind == INDICATOR_OF_MODEL) {
        return z < 0.0;
    }
    return z <= near_root && z_ahead <= z && z_ahead + band_of(instance, indicator) <= 0.0;
}

/* Writes all indicators, and their kinds. */
static enum status evaluate(struct instance *instance, const double x[], double z[]) {
    const struct model *model = instance->model;
    const double *u = doubles_of(instance->memory.values, model->inputs);
    model->events->describe(instance->memory.values, instance->indicators);
    return model->events->indicators(instance->memory.values, instance->state.time.s, x, u, z);
}

/* Writes which indicators have triggered while the inputs stay. */
static enum status find_triggered(struct instance *instance, bool triggered[], bool *is_any) {
    const struct model *model = instance->model;
    char *values = instance->memory.values;
    const double *x = doubles_of(values, model->states);
    const double *u = doubles_of(values, model->inputs);
    double *dx = doubles_of(instance->first_derivatives, model->derivatives);
    double *ahead = doubles_of(instance->second_derivatives, model->states);
    double *z = instance->z;
    double *z_ahead = z + model->events->indicator_count;
    enum status status = model->right_hand_side(values, instance->state.time.s, x, u, dx);
    for (size_t i = 0; i < count_of(model->states); i++) {
        ahead[i] = x[i] + slope_time * dx[i];
    }
    if (status == STATUS_OK) {
        status = evaluate(instance, x, z);
    }
    if (status == STATUS_OK) {
        status = evaluate(instance, ahead, z_ahead);
    }
    for (size_t i = 0; status == STATUS_OK && i < model->events->indicator_count; i++) {
        triggered[i] = has_triggered(instance, i, z[i], z_ahead[i]);
        *is_any |= triggered[i];
    }
    return status;
}

static bool can_fire(const struct instance *instance) {
    const struct model_events *events = instance->model->events;
    return events != NULL && events->are_possible != NULL &&
           events->are_possible(instance->memory.values);
}

void instance_note_due(struct instance *instance) {
    instance_forget_due(instance);
    bool is_any = false;
    if (can_fire(instance) &&
        find_triggered(instance, instance->memory.unhandled, &is_any) == STATUS_OK && is_any) {
        instance->state.event_point = EVENT_DUE;
    }
}

void instance_forget_due(struct instance *instance) {
    memset(instance->memory.unhandled, 0, instance_event_size(instance->model));
    instance->state.event_point = NO_EVENT;
}

/* Leaves in triggered the forces that are still below 0 with what is set now. */
static enum status forget_past_forces(struct instance *instance, bool triggered[]) {
    if (!can_fire(instance)) {
        return STATUS_OK;
    }
    double *x = doubles_of(instance->memory.values, instance->model->states);
    if (evaluate(instance, x, instance->z) != STATUS_OK) {
        return instance_not_finite(instance, "an event indicator");
    }
    for (size_t i = 0; i < instance->model->events->indicator_count; i++) {
        triggered[i] = triggered[i] &&
                       (instance->indicators[i].kind != INDICATOR_OF_MODEL || instance->z[i] < 0.0);
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
    triggered[events->indicator_count] = instance_next_time(instance) - now <= clock_spacing(now);
    const bool is_any =
        instance->state.event_point == EVENT_DUE || triggered[events->indicator_count];
    instance_forget_due(instance);
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
        status = instance_update_modes(instance, is_any ? triggered : NULL);
    }
    *states_changed = memcmp(before, instance->memory.values + states.offset, states.size) != 0;
    return status;
}

static void refuse_state_event(const struct instance *instance, const bool triggered[]) {
    size_t first = 0;
    while (!triggered[first]) {
        first++;
    }
    message_write(&instance->sink, STATUS_TOO_MANY_EVENTS,
                  "the step ended at t = %.17g: %s fell to 0, one more event than "
                  "max_events = %d",
                  instance->state.own.time, instance->model->events->indicator_names[first],
                  instance->state.own.max_events);
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
    if (!is_time_event && in_step->of_states >= own->max_events) {
        refuse_state_event(instance, triggered);
        return STATUS_TOO_MANY_EVENTS;
    }
    *(is_time_event ? &in_step->of_time : &in_step->of_states) += 1;
    own->event_count += own->event_count < INT_MAX ? 1 : 0;
    own->last_event_time = own->time;
    return STATUS_OK;
}
