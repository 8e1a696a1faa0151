#include "variable_access.h"

#include "derivatives.h"
#include "model_description.h"
#include "values.h"

/* ---- Values --------------------------------------------------------------------------------- */

#define ACCESS(access, of_instance, setting, element)                                              \
    enum component_status access(struct component *component, unsigned call,                       \
                                 const unsigned references[], size_t count, element values[]) {    \
        if (!component_enter(component, call) ||                                                   \
            !component_has_arrays(component, call, count, references, values) ||                   \
            (component->state == STATE_INTERMEDIATE_UPDATE &&                                      \
             !component->adapter->may_access(component, call, setting, references, count))) {      \
            return COMPONENT_ERROR;                                                                \
        }                                                                                          \
        return component_result(component,                                                         \
                                of_instance(component->instance, references, count, values));      \
    }
#define GET_AND_SET(name, constant, element)                                                       \
    ACCESS(access_get_##name, instance_get_##name, false, element)                                 \
    ACCESS(access_set_##name, instance_set_##name, true, const element)
VALUE_TYPE_LIST(GET_AND_SET)

enum component_status access_none(struct component *component, unsigned call, const char *type,
                                  const unsigned references[], size_t count, const void *values) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, count, references, values)) {
        return COMPONENT_ERROR;
    }
    if (count > 0) {
        return component_fail(component,
                              "value reference %u is accessed as %s: %s has no variable of that "
                              "type",
                              references[0], type, model_description.name);
    }
    return COMPONENT_OK;
}

/* ---- Derivatives ---------------------------------------------------------------------------- */

enum component_status access_set_input_derivatives(struct component *component, unsigned call,
                                                   const unsigned references[], size_t count,
                                                   const int orders[], const double values[]) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, count, references, values) ||
        !component_has_arrays(component, call, count, orders, orders)) {
        return COMPONENT_ERROR;
    }
    return component_result(component, instance_set_input_derivatives(
                                           component->instance, references, count, orders, values));
}

enum component_status access_get_output_derivatives(struct component *component, unsigned call,
                                                    const unsigned references[], size_t count,
                                                    const int orders[], double values[]) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, count, references, values) ||
        !component_has_arrays(component, call, count, orders, orders)) {
        return COMPONENT_ERROR;
    }
    return component_result(component, instance_get_output_derivatives(
                                           component->instance, references, count, orders, values));
}

enum component_status access_get_directional_derivative(struct component *component, unsigned call,
                                                        const unsigned unknowns[],
                                                        size_t unknown_count,
                                                        const unsigned knowns[], size_t known_count,
                                                        const double seed[], double result[]) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, unknown_count, unknowns, result) ||
        !component_has_arrays(component, call, known_count, knowns, seed)) {
        return COMPONENT_ERROR;
    }
    return component_result(component,
                            instance_get_directional_derivative(
                                component->instance, component->adapter->knowns, unknowns,
                                unknown_count, knowns, known_count, seed, result));
}

enum component_status access_get_adjoint_derivative(struct component *component, unsigned call,
                                                    const unsigned unknowns[], size_t unknown_count,
                                                    const unsigned knowns[], size_t known_count,
                                                    const double seed[], double result[]) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, unknown_count, unknowns, seed) ||
        !component_has_arrays(component, call, known_count, knowns, result)) {
        return COMPONENT_ERROR;
    }
    return component_result(
        component,
        instance_get_adjoint_derivative(component->instance, component->adapter->knowns, unknowns,
                                        unknown_count, knowns, known_count, seed, result));
}
