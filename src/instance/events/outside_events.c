#include "outside_events.h"

#include "fields.h"
#include "model_modes.h"
#include "settings.h"

#include <math.h>
#include <string.h>

/* Of the size of an indicator: how far from its root integrators stop. */
static const double near_root = 1e-10;

/* The size of an indicator of a state. */
static double size_of(const struct instance *instance, const struct indicator *indicator) {
    return fabs(indicator->factor) * instance_nominal(instance, indicator->state) +
           fabs(indicator->offset);
}

/* Writes what is added to each indicator: it falls to 0 only this far beyond its root. A mode may
 * begin at the root, and integrators miss falls that begin at 0. For an indicator of a state: far
 * above the rounding of its two parts, which are the state's nominal value and the offset, and far
 * below the error of integrators. For one of the model: so large that the force is past its limit
 * wherever an integrator stops, however the inputs move. Writes the kinds of indicators, too. */
static void write_bands(struct instance *instance, double bands[]) {
    const struct model_events *events = instance->model->events;
    events->describe(instance->memory.values, instance->indicators);
    if (events->errors != NULL) {
        double *errors = doubles_of(instance->first_derivatives, instance->model->states);
        instance_write_location_errors(instance, errors);
        events->errors(instance->memory.values, instance->state.time.s, errors, 1e-12, bands);
    }
    for (size_t i = 0; i < events->indicator_count; i++) {
        const struct indicator *indicator = &instance->indicators[i];
        if (indicator->kind == INDICATOR_UNUSED) {
            bands[i] = 0.0;
        } else if (indicator->kind == INDICATOR_OF_STATE) {
            const double nominal = instance_nominal(instance, indicator->state);
            bands[i] = 1e-12 * fabs(indicator->factor) * nominal + 1e-14 * fabs(indicator->offset);
        } else if (events->errors == NULL) {
            bands[i] = 2.0 * near_root + 1e-9 * fabs(indicator->offset);
        }
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

/* s: the slope of an indicator is its difference over this time. */
static const double slope_time = 1e-7;

/* An indicator that has come to 0. */
struct arrival {
    double z;
    double slope; /* 1/s, while the inputs stay */
    double band;
};

/* It falls. Where a mode has just begun at 0, rounding may let it fall, but not past the band. */
static bool has_state_fallen(const struct arrival *at, double size) {
    const double ahead = at->z + slope_time * at->slope;
    return at->z <= near_root * size && ahead <= at->z && ahead + at->band <= 0.0;
}

/* It is below 0. How inputs move is not known, so that it may fall though it seems to rise; but one
 * that rises since the last event, from not far below 0, has not fallen. since: s. */
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

/* Writes all indicators now and, along the motion that begins here while the inputs stay, after
 * each slope_time: at so many points, 3 at most. */
static enum status look_ahead(struct instance *instance, size_t points) {
    const struct model *model = instance->model;
    const double *u = doubles_of(instance->memory.values, model->inputs);
    double *x = doubles_of(instance->first_derivatives, model->states);
    double *dx = doubles_of(instance->second_derivatives, model->derivatives);
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

/* Some indicator is below 0: else no event can have been missed, which is so after most steps. */
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
    // one that only comes to 0 will be seen
    bool is_missed = false;
    for (size_t i = 0; is_any && i < instance->model->events->indicator_count; i++) {
        is_missed |= instance->triggered[i] && instance->z[i] < 0.0;
    }
    return is_missed;
}

/* Takes forces out of triggered that are not below 0 with the values set now. */
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

/* z: an indicator at three times in equal distances. It moves to 0 and turns before it comes there.
 */
static bool turns_before_zero(double z, double ahead, double far_ahead) {
    const double side = z < 0.0 ? -1.0 : 1.0;
    const double slope = side * (ahead - z);
    const double bend = side * (far_ahead - 2.0 * ahead + z);
    return slope < 0.0 && bend > 0.0 && side * z - slope * slope / (2.0 * bend) >= 0.0;
}

/* Where impacts follow each other ever faster, an event that leaves the state beyond its limit is
 * followed by a flight that ends before it. No further event would come. */
static enum status refuse_unseen_events(struct instance *instance, const bool triggered[]) {
    const size_t count = instance->model->events->indicator_count;
    if (instance->model->events->errors == NULL || look_ahead(instance, 3) != STATUS_OK) {
        return STATUS_OK;
    }
    const double *z = instance->z;
    for (size_t i = 0; i < count; i++) {
        if (triggered[i] && instance->indicators[i].kind != INDICATOR_UNUSED &&
            turns_before_zero(z[i], z[count + i], z[2 * count + i])) {
            message_write(&instance->sink, STATUS_INTERNAL,
                          "at t = %.17g: events at which %s falls to 0 follow each other faster "
                          "than they can be seen from outside: let a mode rest, or set the states "
                          "onto the limit",
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
    return status == STATUS_OK && is_any ? refuse_unseen_events(instance, triggered) : status;
}
