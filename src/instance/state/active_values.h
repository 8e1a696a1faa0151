/* Whether the values set now are the active ones: those that the integrator runs with since its
 * last restart. Inline, because each step asks for it. */
#ifndef INSTANCE_ACTIVE_VALUES_H
#define INSTANCE_ACTIVE_VALUES_H

#include "internals.h"

#include <string.h>

/* The inputs of the next step are constant and equal to the active ones. Polynomials need no
 * comparison: the horizon of the integrator ends with the step that they are for. */
static inline bool instance_inputs_are_active(const struct instance *instance) {
    const struct instance_memory *memory = &instance->memory;
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        const struct polynomial *next = &memory->next_inputs[i];
        if (next->d[0] != memory->active_inputs[i].d[0] ||
            (!instance->inputs_are_held && polynomial_moves(next))) {
            return false;
        }
    }
    return true;
}

static inline bool instance_range_is_active(const struct instance *instance, struct range range) {
    const struct instance_memory *memory = &instance->memory;
    return memcmp(memory->restart_values + range.offset, memory->values + range.offset,
                  range.size) == 0;
}

/* The same for parameters and Boolean inputs. */
static inline bool instance_parameters_are_active(const struct instance *instance) {
    const struct model_events *events = instance->model->events;
    return instance->parameters_are_active ||
           (instance_range_is_active(instance, instance->model->parameters) &&
            (events == NULL || instance_range_is_active(instance, events->discrete_inputs)));
}

static inline bool instance_values_are_active(const struct instance *instance) {
    return instance_inputs_are_active(instance) && instance_parameters_are_active(instance);
}

#endif
