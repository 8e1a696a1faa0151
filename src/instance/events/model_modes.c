#include "model_modes.h"

#include "settings.h"

#include <limits.h>
#include <math.h>

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

double instance_nominal(const struct instance *instance, size_t state) {
    const double relative = instance->state.own.effective_relative_tolerance;
    return instance->absolute_tolerances[state] / (INSTANCE_ABSOLUTE_FRACTION * relative);
}

void instance_write_location_errors(const struct instance *instance, double errors[]) {
    const struct range states = instance->model->states;
    const double *x = doubles_of(instance->memory.values, states);
    for (size_t i = 0; i < count_of(states); i++) {
        errors[i] = 2e-10 * (instance_nominal(instance, i) + fabs(x[i]));
    }
}

/* Error of each state at an event: what the integrator allows or, outside, twice the error of the
 * location, since indicators fall to 0 beyond their roots. */
static void write_tolerances(struct instance *instance) {
    const struct range states = instance->model->states;
    const double *x = doubles_of(instance->memory.values, states);
    const bool is_located_outside =
        instance->is_integrated_outside && instance->model->events->errors != NULL;
    double *tolerances = instance->tolerances;
    if (is_located_outside) {
        instance_write_location_errors(instance, tolerances);
    }
    for (size_t i = 0; i < count_of(states); i++) {
        const double allowed = instance->absolute_tolerances[i] +
                               instance->state.own.effective_relative_tolerance * fabs(x[i]);
        tolerances[i] = is_located_outside ? fmax(allowed, 2.0 * tolerances[i]) : allowed;
    }
}

/* triggered, of struct instance, says that a time event has come. */
static bool is_timed(const struct instance *instance, const bool *triggered) {
    return triggered != NULL && triggered[instance->model->events->indicator_count];
}

/* Time events must not follow each other at the same time without end. */
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
        .du_is_known = !instance->is_integrated_outside,
        .tolerance = instance->tolerances,
        .max_events = instance->state.own.max_events,
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
