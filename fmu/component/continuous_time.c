#include "continuous_time.h"

#include "continuous_states.h"
#include "model_description.h"
#include "values.h"

enum component_status continuous_set_time(struct component *component, unsigned call, double time) {
    if (!component_enter(component, call)) {
        return COMPONENT_ERROR;
    }
    return component_result(component, instance_set_time(component->instance, time));
}

enum component_status continuous_set_states(struct component *component, unsigned call,
                                            const double x[], size_t count) {
    if (!component_enter(component, call) || !component_has_arrays(component, call, count, x, x)) {
        return COMPONENT_ERROR;
    }
    return component_result(component, instance_set_states(component->instance, x, count));
}

enum component_status continuous_get_states(struct component *component, unsigned call, double x[],
                                            size_t count) {
    if (!component_enter(component, call) || !component_has_arrays(component, call, count, x, x)) {
        return COMPONENT_ERROR;
    }
    return component_result(component, instance_get_states(component->instance, x, count));
}

enum component_status continuous_get_derivatives(struct component *component, unsigned call,
                                                 double dx[], size_t count) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, count, dx, dx)) {
        return COMPONENT_ERROR;
    }
    return component_result(component, instance_get_derivatives(component->instance, dx, count));
}

enum component_status continuous_get_nominals(struct component *component, unsigned call,
                                              double nominals[], size_t count) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, count, nominals, nominals)) {
        return COMPONENT_ERROR;
    }
    return component_result(component, instance_get_nominals(component->instance, nominals, count));
}

enum component_status continuous_get_indicators(struct component *component, unsigned call,
                                                double indicators[], size_t count) {
    const size_t expected = model_description.indicator_count;
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, count, indicators, indicators)) {
        return COMPONENT_ERROR;
    }
    if (count != expected) {
        return component_fail(component, "%zu event indicators are accessed: there are %zu", count,
                              expected);
    }
    return component_result(
        component,
        instance_get_real(component->instance, model_description.indicators, count, indicators));
}

enum component_status continuous_complete_step(struct component *component, unsigned call,
                                               const void *enters, const void *terminates,
                                               bool *is_event) {
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, 1, enters, terminates)) {
        return COMPONENT_ERROR;
    }
    *is_event = instance_complete_step(component->instance);
    return COMPONENT_OK;
}
