#include "model_modes.h"

#include "fields.h"

#include <limits.h>

bool instance_is_searched(const struct instance *instance) {
    const struct model_events *events = instance->model->events;
    return events != NULL && events->are_possible(instance->memory.held);
}

bool instance_is_at_rest(const struct instance *instance) {
    const struct model_events *events = instance->model->events;
    return events != NULL && events->is_at_rest(instance->memory.values);
}

const struct indicator *instance_describe_indicators(struct instance *instance) {
    if (!instance_is_searched(instance)) {
        return NULL;
    }
    instance->model->events->describe(instance->memory.held, instance->indicators);
    return instance->indicators;
}

static enum status update(struct instance *instance, const bool *fired) {
    const struct model_events *events = instance->model->events;
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        instance->du[i] = instance->memory.current[i].d[1];
    }
    const struct event event = {
        .t = instance->state.time.s,
        .fired = fired,
        .du = instance->du,
        .tolerance = instance->absolute_tolerances,
    };
    const enum status status = events->update(instance->memory.values, &event);
    if (status != STATUS_OK) {
        message_write(&instance->sink, status, "no modes at t = %.17g: %s", event.t,
                      status_text(status));
    }
    return status;
}

enum status instance_update_modes(struct instance *instance, const bool *fired) {
    if (instance->model->events == NULL) {
        return STATUS_OK;
    }
    instance->outputs_are_valid = false;
    return update(instance, fired);
}

enum status instance_count_event(struct instance *instance, const bool fired[],
                                 int *count_in_step) {
    const struct model_events *events = instance->model->events;
    struct instance_values *own = &instance->state.own;
    if (*count_in_step >= own->max_events) {
        size_t first = 0;
        while (!fired[first]) {
            first++;
        }
        message_write(&instance->sink, STATUS_TOO_MANY_EVENTS,
                      "event %d of the step, %s at t = %.17g, is one more than max_events = %d",
                      *count_in_step + 1, events->indicator_names[first], own->time,
                      own->max_events);
        return STATUS_TOO_MANY_EVENTS;
    }
    ++*count_in_step;
    own->event_count += own->event_count < INT_MAX ? 1 : 0;
    own->last_event_time = own->time;
    return STATUS_OK;
}
