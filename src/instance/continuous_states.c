#include "continuous_states.h"

#include "failures.h"
#include "modes.h"
#include "state.h"
#include "values.h"

#include <math.h>
#include <string.h>

enum status instance_enter_continuous_time(struct instance *instance) {
    const enum status status = instance_check_parameters(instance);
    if (status == STATUS_OK) {
        instance->state.phase = PHASE_CONTINUOUS_TIME;
        instance_forget_unhandled(instance);
        instance_note_inputs(instance);
        if (instance->is_integrated_outside) {
            instance_move_anchors(instance);
        }
    }
    return status;
}

void instance_enter_event_mode(struct instance *instance) {
    instance->state.phase = PHASE_STEPPING;
    if (instance->is_integrated_outside) {
        instance_note_unhandled(instance);
    }
}

enum status instance_complete_step(struct instance *instance, bool *has_event) {
    instance_note_inputs(instance);
    instance_move_anchors(instance);
    *has_event = instance_has_missed_event(instance);
    return instance_check_conditions(instance);
}

static enum status update_discrete_states(struct instance *instance, bool *states_changed) {
    if (instance->is_integrated_outside) {
        return instance_update_at_point(instance, states_changed);
    }
    *states_changed = false; // continuous states are the integrator's own
    if (instance->state.event_point == EVENT_UNHANDLED) {
        struct event_counts none = {0};
        return instance_handle_event(instance, &none);
    }
    return instance_is_unchanged(instance) ? STATUS_OK : instance_update_modes(instance, NULL);
}

enum status instance_update_discrete_states(struct instance *instance,
                                            struct discrete_update *update) {
    const enum status status = update_discrete_states(instance, &update->states_changed);
    update->has_ended = instance_explain_end(instance, NULL, 0);
    update->next_time = instance_next_time(instance);
    update->is_incomplete =
        instance->is_integrated_outside && update->next_time <= instance->state.time.s;
    return status;
}

enum status instance_set_time(struct instance *instance, double time) {
    if (!isfinite(time)) {
        message_write(&instance->sink, STATUS_NOT_FINITE,
                      "time %g is refused: a finite time is expected", time);
        return STATUS_NOT_FINITE;
    }
    instance_set_clock(instance, (struct clock_time){.s = time});
    return STATUS_OK;
}

size_t instance_state_count(const struct instance *instance) {
    return count_of(instance->model->states);
}

/* Returns STATUS_OK if there are as many continuous states, or event indicators, as are accessed.
 */
static enum status check_count(const struct instance *instance, const char *what, size_t count,
                               size_t expected) {
    if (count == expected) {
        return STATUS_OK;
    }
    message_write(&instance->sink, STATUS_INVALID_ARGUMENT, "%zu %s are accessed: there are %zu",
                  count, what, expected);
    return STATUS_INVALID_ARGUMENT;
}

static enum status check_states(const struct instance *instance, size_t count) {
    return check_count(instance, "continuous states", count, instance_state_count(instance));
}

enum status instance_set_states(struct instance *instance, const double x[], size_t count) {
    const enum status status = check_states(instance, count);
    if (status != STATUS_OK) {
        return status;
    }
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(x[i])) {
            message_write(&instance->sink, STATUS_NOT_FINITE,
                          "state %zu = %g is refused: a finite value is expected", i + 1, x[i]);
            return STATUS_NOT_FINITE;
        }
    }
    if (count > 0) {
        memcpy(doubles_of(instance->memory.values, instance->model->states), x,
               count * sizeof(double));
    }
    instance->outputs_are_valid = false;
    return STATUS_OK;
}

/* Copies doubles of the values shown. */
static enum status copy_finite(struct instance *instance, struct range range, double to[]) {
    const double *from = doubles_of(instance_shown_values(instance), range);
    for (size_t i = 0; i < count_of(range); i++) {
        if (!isfinite(from[i])) {
            return instance_field_not_finite(instance, range.offset + i * sizeof *from);
        }
    }
    if (range.size > 0) {
        memcpy(to, from, range.size);
    }
    return STATUS_OK;
}

enum status instance_get_states(struct instance *instance, double x[], size_t count) {
    const enum status status = check_states(instance, count);
    return status != STATUS_OK ? status : copy_finite(instance, instance->model->states, x);
}

enum status instance_get_derivatives(struct instance *instance, double dx[], size_t count) {
    enum status status = check_states(instance, count);
    if (status == STATUS_OK) {
        status = instance_update_outputs(instance);
    }
    return status != STATUS_OK ? status : copy_finite(instance, instance->model->dx, dx);
}

enum status instance_get_nominals(struct instance *instance, double nominals[], size_t count) {
    const struct range states = instance->model->states;
    const enum status status = check_states(instance, count);
    for (size_t i = 0; status == STATUS_OK && i < instance->description->variable_count; i++) {
        const struct variable *variable = &instance->description->variables[i];
        const size_t from_states = variable->offset - states.offset;
        if (variable->owner == VARIABLE_OF_MODEL && from_states < states.size) {
            nominals[from_states / sizeof(double)] = variable->nominal;
        }
    }
    return status;
}

enum status instance_get_indicators(struct instance *instance, double indicators[], size_t count) {
    const struct model_description *description = instance->description;
    const enum status status =
        check_count(instance, "event indicators", count, description->indicator_count);
    return status != STATUS_OK
               ? status
               : instance_get_real(instance, description->indicators, count, indicators);
}
