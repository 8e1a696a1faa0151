/* Access of an instance's values. */
#include "internals.h"

#include <math.h>
#include <string.h>

/* ---- Fields --------------------------------------------------------------------------------- */

void *instance_field(struct instance *instance, const struct variable *variable) {
    char *structure = variable->owner == VARIABLE_OF_MODEL ? instance->memory.values
                                                           : (char *)(void *)&instance->state.own;
    return structure + variable->offset;
}

size_t instance_input_index(const struct instance *instance, const struct variable *variable) {
    return (variable->offset - instance->model->inputs.offset) / sizeof(double);
}

void instance_write_field(struct instance *instance, const struct variable *variable,
                          double value) {
    if (variable->type == VARIABLE_INT32) {
        *(int *)instance_field(instance, variable) = (int)value;
        return;
    }
    *(double *)instance_field(instance, variable) = value;
    if (variable->causality == CAUSALITY_INPUT) {
        const size_t i = instance_input_index(instance, variable);
        instance->memory.pending[i].d[0] = value;
        instance->memory.current[i] = instance->memory.pending[i];
    }
}

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
    }
    return status;
}

enum status instance_not_finite(const struct instance *instance, const char *what) {
    message_write(&instance->sink, STATUS_NOT_FINITE,
                  "%s at t = %.17g is not finite: parameters, states and inputs are too extreme to "
                  "compute it",
                  what, instance->state.time.s);
    return STATUS_NOT_FINITE;
}

/* ---- Variables by reference ----------------------------------------------------------------- */

const struct variable *instance_find(const struct instance *instance, unsigned reference,
                                     enum variable_type type) {
    const struct variable *variable = variable_find(instance->description, reference);
    if (variable == NULL) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "value reference %u is unknown: %s has no such variable", reference,
                      instance->description->name);
        return NULL;
    }
    if (variable->type != type) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "%s (value reference %u) is accessed as %s: it is of type %s", variable->name,
                      reference, variable_type_name(type), variable_type_name(variable->type));
        return NULL;
    }
    return variable;
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

/* ---- All states at once --------------------------------------------------------------------- */

size_t instance_state_count(const struct instance *instance) {
    return count_of(instance->model->states);
}

static enum status check_count(const struct instance *instance, size_t count) {
    if (count == instance_state_count(instance)) {
        return STATUS_OK;
    }
    message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                  "%zu continuous states are accessed: there are %zu", count,
                  instance_state_count(instance));
    return STATUS_INVALID_ARGUMENT;
}

enum status instance_set_states(struct instance *instance, const double x[], size_t count) {
    const enum status status = check_count(instance, count);
    if (status != STATUS_OK) {
        return status;
    }
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(x[i])) {
            message_write(&instance->sink, STATUS_NOT_FINITE,
                          "state %zu = %g is refused: a finite value is expected", i + 1, x[i]);
            return STATUS_NOT_FINITE;
        }
    }
    if (count > 0) {
        memcpy(doubles_of(instance->memory.values, instance->model->states), x,
               count * sizeof(double));
    }
    instance->outputs_are_valid = false;
    return STATUS_OK;
}

static enum status copy_finite(const struct instance *instance, const char *what,
                               const double from[], double to[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(from[i])) {
            return instance_not_finite(instance, what);
        }
    }
    if (count > 0) {
        memcpy(to, from, count * sizeof(double));
    }
    return STATUS_OK;
}

enum status instance_get_states(struct instance *instance, double x[], size_t count) {
    const enum status status = check_count(instance, count);
    return status != STATUS_OK
               ? status
               : copy_finite(instance, "a state",
                             doubles_of(instance->memory.values, instance->model->states), x,
                             count);
}

enum status instance_get_derivatives(struct instance *instance, double dx[], size_t count) {
    enum status status = check_count(instance, count);
    if (status == STATUS_OK) {
        status = instance_update_outputs(instance);
    }
    return status != STATUS_OK
               ? status
               : copy_finite(instance, "the derivative of a state",
                             doubles_of(instance->memory.values, instance->model->derivatives), dx,
                             count);
}

enum status instance_get_nominals(struct instance *instance, double nominals[], size_t count) {
    const struct span states = instance->model->states;
    const enum status status = check_count(instance, count);
    for (size_t i = 0; status == STATUS_OK && i < instance->description->variable_count; i++) {
        const struct variable *variable = &instance->description->variables[i];
        const size_t from_states = variable->offset - states.offset;
        if (variable->owner == VARIABLE_OF_MODEL && from_states < states.size) {
            nominals[from_states / sizeof(double)] = variable->nominal;
        }
    }
    return status;
}
