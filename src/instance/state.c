#include "state.h"

#include <limits.h>

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

static int saturated(int64_t count) {
    return count > INT_MAX ? INT_MAX : (int)count;
}

void instance_write_statistics(const struct integrator_statistics *statistics,
                               struct instance_values *own) {
    own->solver_steps = saturated(statistics->steps);
    own->solver_rhs_evaluations = saturated(statistics->rhs_evaluations);
    own->solver_restarts = saturated(statistics->restarts);
    own->solver_failed_steps = saturated(statistics->failed_steps);
    own->solver_last_step = statistics->last_step;
    own->solver_last_order = statistics->last_order;
}

enum status instance_not_finite(const struct instance *instance, const char *what) {
    message_write(&instance->sink, STATUS_NOT_FINITE,
                  "%s at t = %.17g is not finite: parameters, states and inputs are too extreme to "
                  "compute it",
                  what, instance->state.time.s);
    return STATUS_NOT_FINITE;
}
