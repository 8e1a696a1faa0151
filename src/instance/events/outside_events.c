#include "outside_events.h"

#include "fields.h"
#include "model_modes.h"
#include "settings.h"

#include <math.h>
#include <string.h>

/* In the unit of an indicator: how far from its root integrators stop. */
static const double near_root = 1e-10;

/* What is added to an indicator: it falls to 0 only this far beyond its root. A mode may begin at
 * the root, and integrators miss falls that begin at 0. For an indicator of a state: far above the
 * rounding of its two parts, which are the state's nominal value and the offset, and far below the
 * error of integrators. For one of the model: so large that the force is past its limit wherever an
 * integrator stops, however the inputs move. */
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

/* s: the slope of an indicator is its difference over this time. */
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

/* Takes forces out of triggered that are not below 0 with the values set now. */
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
    triggered[events->indicator_count] =
        instance_next_time(instance) - now <= clock_rounding(instance_size_of_times(instance, now));
    const bool is_any =
        instance->state.event_point == EVENT_UNHANDLED || triggered[events->indicator_count];
    instance_forget_unhandled(instance);
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
