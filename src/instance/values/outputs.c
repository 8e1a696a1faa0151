#include "outputs.h"

#include "outside_events.h"

enum status instance_update_outputs(struct instance *instance) {
    if (instance->outputs_are_valid) {
        return STATUS_OK;
    }
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
