#include "event_point.h"

#include "active_values.h"
#include "model_modes.h"

#include <math.h>
#include <string.h>

void instance_leave_event(struct instance *instance, const bool triggered[],
                          struct clock_time end) {
    memcpy(instance->memory.unhandled, triggered, instance_event_size(instance->model));
    instance->state.event_point = EVENT_UNHANDLED;
    instance->state.cut_end = end;
}

void instance_note_handled_event(struct instance *instance, struct clock_time end) {
    instance->state.event_point = EVENT_HANDLED;
    instance->state.cut_end = end;
}

/* After a change of inputs or parameters, forces may no longer trigger the event; states still do.
 */
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

struct clock_time instance_resumed_end(const struct instance *instance, struct clock_time end) {
    const struct instance_state *state = &instance->state;
    const double difference = clock_difference(end, state->cut_end);
    const double rounding = clock_rounding(instance_size_of_times(instance, end.s));
    return fabs(difference) <= rounding ? state->cut_end : end;
}
