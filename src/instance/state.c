#include "state.h"

const struct variable *instance_refuse_reference(const struct instance *instance,
                                                 unsigned reference, enum variable_type type) {
    const struct variable *variable = variable_find(instance->description, reference);
    if (variable == NULL) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "value reference %u is unknown: %s has no such variable", reference,
                      instance->description->name);
    } else {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "%s (value reference %u) is accessed as %s: it is of type %s", variable->name,
                      reference, variable_type_name(type), variable_type_name(variable->type));
    }
    return NULL;
}

enum status instance_not_finite(const struct instance *instance, const char *what) {
    message_write(&instance->sink, STATUS_NOT_FINITE,
                  "%s at t = %.17g is not finite: parameters, states and inputs are too extreme to "
                  "compute it",
                  what, instance->state.time.s);
    return STATUS_NOT_FINITE;
}
