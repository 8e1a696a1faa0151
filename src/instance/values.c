#include "values.h"

#include "fields.h"
#include "settings.h"

#include <math.h>

/* Of a Real. An input reads as the value set last, also after a step over which it moved. */
static double read_field(struct instance *instance, const struct variable *variable) {
    if (variable->causality == CAUSALITY_INPUT) {
        return instance->memory.pending[instance_input_index(instance, variable)].d[0];
    }
    return *(const double *)instance_field(instance, variable);
}

/* Element i of an array of the C type that belongs to type; every int is exact as a double. */
static double element(enum variable_type type, const void *values, size_t i) {
    return type == VARIABLE_FLOAT64 ? ((const double *)values)[i] : ((const int *)values)[i];
}

static const struct variable *find_settable(const struct instance *instance, unsigned reference,
                                            enum variable_type type) {
    static const char *const when[PHASE_COUNT] = {
        [PHASE_INSTANTIATED] = "at all: only start values and inputs can",
        [PHASE_INITIALIZATION] = "at all: only start values and inputs can",
        [PHASE_STEPPING] = "after initialization: only inputs and tunable parameters can",
        [PHASE_CONTINUOUS_TIME] = "while the time is continuous: only continuous inputs can",
    };
    const struct variable *variable = instance_find(instance, reference, type);
    if (variable != NULL && !variable_is_settable(variable, instance->state.phase)) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "%s (value reference %u) cannot be set %s", variable->name, reference,
                      when[instance->state.phase]);
        return NULL;
    }
    return variable;
}

static enum status set(struct instance *instance, enum variable_type type,
                       const unsigned references[], size_t count, const void *values) {
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable = find_settable(instance, references[i], type);
        if (variable == NULL) {
            return STATUS_INVALID_ARGUMENT;
        }
        const enum status status =
            variable_check_value(variable, element(type, values, i), &instance->sink);
        if (status != STATUS_OK) {
            return status;
        }
    }
    bool is_setting = false;
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable = variable_of(instance->description, references[i]);
        instance_write_field(instance, variable, element(type, values, i));
        is_setting |= variable->owner == VARIABLE_OF_INSTANCE;
    }
    instance->outputs_are_valid = false;
    if (is_setting) {
        instance_update_tolerance(instance);
    }
    return STATUS_OK;
}

enum status instance_set_real(struct instance *instance, const unsigned references[], size_t count,
                              const double values[]) {
    return set(instance, VARIABLE_FLOAT64, references, count, values);
}

enum status instance_set_integer(struct instance *instance, const unsigned references[],
                                 size_t count, const int values[]) {
    return set(instance, VARIABLE_INT32, references, count, values);
}

enum status instance_get_real(struct instance *instance, const unsigned references[], size_t count,
                              double values[]) {
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable = instance_find(instance, references[i], VARIABLE_FLOAT64);
        if (variable == NULL) {
            return STATUS_INVALID_ARGUMENT;
        }
        if (variable->initial == INITIAL_CALCULATED && variable->owner == VARIABLE_OF_MODEL) {
            const enum status status = instance_update_outputs(instance);
            if (status != STATUS_OK) {
                return status;
            }
        }
        if (!isfinite(read_field(instance, variable))) {
            return instance_not_finite(instance, variable->name);
        }
    }
    for (size_t i = 0; i < count; i++) {
        values[i] = read_field(instance, variable_of(instance->description, references[i]));
    }
    return STATUS_OK;
}

enum status instance_get_integer(struct instance *instance, const unsigned references[],
                                 size_t count, int values[]) {
    for (size_t i = 0; i < count; i++) {
        if (instance_find(instance, references[i], VARIABLE_INT32) == NULL) {
            return STATUS_INVALID_ARGUMENT;
        }
    }
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable = variable_of(instance->description, references[i]);
        values[i] = *(const int *)instance_field(instance, variable);
    }
    return STATUS_OK;
}
