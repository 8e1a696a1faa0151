#include "variable_access.h"

#include "derivatives.h"
#include "model_description.h"
#include "values.h"

/* ---- Values --------------------------------------------------------------------------------- */

enum component_status access_get_real(struct component *component, unsigned call,
                                      const unsigned references[], size_t count, double values[]) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, count, references, values)) {
        return COMPONENT_ERROR;
    }
    return component_result(component,
                            instance_get_real(component->instance, references, count, values));
}

enum component_status access_set_real(struct component *component, unsigned call,
                                      const unsigned references[], size_t count,
                                      const double values[]) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, count, references, values)) {
        return COMPONENT_ERROR;
    }
    return component_result(component,
                            instance_set_real(component->instance, references, count, values));
}

enum component_status access_get_integer(struct component *component, unsigned call,
                                         const unsigned references[], size_t count, int values[]) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, count, references, values)) {
        return COMPONENT_ERROR;
    }
    return component_result(component,
                            instance_get_integer(component->instance, references, count, values));
}

enum component_status access_set_integer(struct component *component, unsigned call,
                                         const unsigned references[], size_t count,
                                         const int values[]) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, count, references, values)) {
        return COMPONENT_ERROR;
    }
    return component_result(component,
                            instance_set_integer(component->instance, references, count, values));
}

enum component_status access_get_int32(struct component *component, unsigned call,
                                       const unsigned references[], size_t count, int values[]) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, count, references, values)) {
        return COMPONENT_ERROR;
    }
    return component_result(component,
                            instance_get_int32(component->instance, references, count, values));
}

enum component_status access_set_int32(struct component *component, unsigned call,
                                       const unsigned references[], size_t count,
                                       const int values[]) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, count, references, values)) {
        return COMPONENT_ERROR;
    }
    return component_result(component,
                            instance_set_int32(component->instance, references, count, values));
}

enum component_status access_get_enumeration(struct component *component, unsigned call,
                                             const unsigned references[], size_t count,
                                             int64_t values[]) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, count, references, values)) {
        return COMPONENT_ERROR;
    }
    return component_result(
        component, instance_get_enumeration(component->instance, references, count, values));
}

enum component_status access_set_enumeration(struct component *component, unsigned call,
                                             const unsigned references[], size_t count,
                                             const int64_t values[]) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, count, references, values)) {
        return COMPONENT_ERROR;
    }
    return component_result(
        component, instance_set_enumeration(component->instance, references, count, values));
}

enum component_status access_get_boolean(struct component *component, unsigned call,
                                         const unsigned references[], size_t count, int values[]) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, count, references, values)) {
        return COMPONENT_ERROR;
    }
    return component_result(component,
                            instance_get_boolean(component->instance, references, count, values));
}

enum component_status access_get_bool(struct component *component, unsigned call,
                                      const unsigned references[], size_t count, bool values[]) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, count, references, values)) {
        return COMPONENT_ERROR;
    }
    return component_result(component,
                            instance_get_bool(component->instance, references, count, values));
}

enum component_status access_set_boolean(struct component *component, unsigned call,
                                         const unsigned references[], size_t count,
                                         const int values[]) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, count, references, values)) {
        return COMPONENT_ERROR;
    }
    return component_result(component,
                            instance_set_boolean(component->instance, references, count, values));
}

enum component_status access_set_bool(struct component *component, unsigned call,
                                      const unsigned references[], size_t count,
                                      const bool values[]) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, count, references, values)) {
        return COMPONENT_ERROR;
    }
    return component_result(component,
                            instance_set_bool(component->instance, references, count, values));
}

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
