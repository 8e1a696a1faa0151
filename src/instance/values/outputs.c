#include "outputs.h"

#include "model_modes.h"
#include "outside_events.h"
#include "settings.h"

#include <string.h>

/* Calculates all from parameters, inputs, states and modes. */
static enum status calculate(struct instance *instance) {
    const enum status status =
        instance->model->outputs(instance->memory.values, instance->state.time.s);
    instance->outputs_are_valid = status == STATUS_OK;
    if (status != STATUS_OK) {
        message_write(&instance->sink, status, "no outputs at t = %.17g: %s",
                      instance->state.time.s, status_text(status));
    } else if (instance->is_integrated_outside && instance->model->events != NULL) {
        instance_add_bands(instance);
    }
    return status;
}

void instance_look_ahead(struct instance *instance) {
    const size_t size = instance->model->values_size;
    const struct message_sink sink = instance->sink;
    char *values = instance->memory.values;
    char *before = instance->second_derivatives;
    memcpy(before, values, size);
    memcpy(instance->initial_values, values, size);
    instance->sink = (struct message_sink){0};
    if (instance_check_parameters(instance) == STATUS_OK &&
        instance_update_modes(instance, NULL) == STATUS_OK) {
        (void)calculate(instance);
        memcpy(instance->initial_values, values, size);
    }
    instance->sink = sink;
    instance->outputs_are_valid = false;
    memcpy(values, before, size);
}

enum status instance_update_outputs(struct instance *instance) {
    if (instance->outputs_are_valid) {
        return STATUS_OK;
    }
    const enum status status = calculate(instance);
    if (status == STATUS_OK && instance_shown_values(instance) != instance->memory.values) {
        instance_look_ahead(instance);
        instance->outputs_are_valid = true;
    }
    return status;
}
