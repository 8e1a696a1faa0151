/* Access of an instance's values. */
#include "slave_state.h"

#include <math.h>
#include <string.h>

/* ---- Fields --------------------------------------------------------------------------------- */

void *slave_field(struct slave *slave, const struct variable *variable) {
    char *structure = variable->owner == VARIABLE_OF_MODEL ? slave->memory.values
                                                           : (char *)(void *)&slave->state.own;
    return structure + variable->offset;
}

size_t slave_input_index(const struct slave *slave, const struct variable *variable) {
    return (variable->offset - slave->model->inputs.offset) / sizeof(double);
}

void slave_write_field(struct slave *slave, const struct variable *variable, double value) {
    if (variable->type == VARIABLE_INTEGER) {
        *(int *)slave_field(slave, variable) = (int)value;
        return;
    }
    *(double *)slave_field(slave, variable) = value;
    if (variable->causality == CAUSALITY_INPUT) {
        const size_t i = slave_input_index(slave, variable);
        slave->memory.pending[i].d[0] = value;
        slave->memory.current[i] = slave->memory.pending[i];
    }
}

/* Of a Real. An input reads as the value set last, also after a step over which it moved. */
static double read_field(struct slave *slave, const struct variable *variable) {
    if (variable->causality == CAUSALITY_INPUT) {
        return slave->memory.pending[slave_input_index(slave, variable)].d[0];
    }
    return *(const double *)slave_field(slave, variable);
}

/* Element i of an array of the C type that belongs to type; every int is exact as a double. */
static double element(enum variable_type type, const void *values, size_t i) {
    return type == VARIABLE_REAL ? ((const double *)values)[i] : ((const int *)values)[i];
}

enum status slave_update_outputs(struct slave *slave) {
    if (slave->outputs_are_valid) {
        return STATUS_OK;
    }
    const enum status status = slave->model->outputs(slave->memory.values, slave->state.time.s);
    slave->outputs_are_valid = status == STATUS_OK;
    if (status != STATUS_OK) {
        message_write(&slave->sink, status, "no outputs at t = %.17g: %s", slave->state.time.s,
                      status_text(status));
    }
    return status;
}

enum status slave_not_finite(const struct slave *slave, const char *what) {
    message_write(&slave->sink, STATUS_NOT_FINITE,
                  "%s at t = %.17g is not finite: parameters, states and inputs are too extreme to "
                  "compute it",
                  what, slave->state.time.s);
    return STATUS_NOT_FINITE;
}

/* ---- Variables by reference ----------------------------------------------------------------- */

const struct variable *slave_find(const struct slave *slave, unsigned reference,
                                  enum variable_type type) {
    const struct variable *variable = variable_find(slave->unit, reference);
    if (variable == NULL) {
        message_write(&slave->sink, STATUS_INVALID_ARGUMENT,
                      "value reference %u is unknown: %s has no such variable", reference,
                      slave->unit->name);
        return NULL;
    }
    if (variable->type != type) {
        message_write(&slave->sink, STATUS_INVALID_ARGUMENT,
                      "%s (value reference %u) is accessed as %s: it is of type %s", variable->name,
                      reference, variable_type_name(type), variable_type_name(variable->type));
        return NULL;
    }
    return variable;
}

static const struct variable *find_settable(const struct slave *slave, unsigned reference,
                                            enum variable_type type) {
    static const char *const when[PHASE_COUNT] = {
        [PHASE_INSTANTIATED] = "at all: only start values and inputs can",
        [PHASE_INITIALIZATION] = "at all: only start values and inputs can",
        [PHASE_STEPPING] = "after initialization: only inputs and tunable parameters can",
        [PHASE_CONTINUOUS_TIME] = "while the time is continuous: only continuous inputs can",
    };
    const struct variable *variable = slave_find(slave, reference, type);
    if (variable != NULL && !variable_is_settable(variable, slave->state.phase)) {
        message_write(&slave->sink, STATUS_INVALID_ARGUMENT,
                      "%s (value reference %u) cannot be set %s", variable->name, reference,
                      when[slave->state.phase]);
        return NULL;
    }
    return variable;
}

static enum status set(struct slave *slave, enum variable_type type, const unsigned references[],
                       size_t count, const void *values) {
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable = find_settable(slave, references[i], type);
        if (variable == NULL) {
            return STATUS_INVALID_ARGUMENT;
        }
        const enum status status =
            variable_check_value(variable, element(type, values, i), &slave->sink);
        if (status != STATUS_OK) {
            return status;
        }
    }
    bool is_setting = false;
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable = variable_of(slave->unit, references[i]);
        slave_write_field(slave, variable, element(type, values, i));
        is_setting |= variable->owner == VARIABLE_OF_SLAVE;
    }
    slave->outputs_are_valid = false;
    if (is_setting) {
        slave_update_tolerance(slave);
    }
    return STATUS_OK;
}

enum status slave_set_real(struct slave *slave, const unsigned references[], size_t count,
                           const double values[]) {
    return set(slave, VARIABLE_REAL, references, count, values);
}

enum status slave_set_integer(struct slave *slave, const unsigned references[], size_t count,
                              const int values[]) {
    return set(slave, VARIABLE_INTEGER, references, count, values);
}

enum status slave_get_real(struct slave *slave, const unsigned references[], size_t count,
                           double values[]) {
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable = slave_find(slave, references[i], VARIABLE_REAL);
        if (variable == NULL) {
            return STATUS_INVALID_ARGUMENT;
        }
        if (variable->initial == INITIAL_CALCULATED && variable->owner == VARIABLE_OF_MODEL) {
            const enum status status = slave_update_outputs(slave);
            if (status != STATUS_OK) {
                return status;
            }
        }
        if (!isfinite(read_field(slave, variable))) {
            return slave_not_finite(slave, variable->name);
        }
    }
    for (size_t i = 0; i < count; i++) {
        values[i] = read_field(slave, variable_of(slave->unit, references[i]));
    }
    return STATUS_OK;
}

enum status slave_get_integer(struct slave *slave, const unsigned references[], size_t count,
                              int values[]) {
    for (size_t i = 0; i < count; i++) {
        if (slave_find(slave, references[i], VARIABLE_INTEGER) == NULL) {
            return STATUS_INVALID_ARGUMENT;
        }
    }
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable = variable_of(slave->unit, references[i]);
        values[i] = *(const int *)slave_field(slave, variable);
    }
    return STATUS_OK;
}

/* ---- All states at once --------------------------------------------------------------------- */

size_t slave_state_count(const struct slave *slave) {
    return count_of(slave->model->states);
}

static enum status check_count(const struct slave *slave, size_t count) {
    if (count == slave_state_count(slave)) {
        return STATUS_OK;
    }
    message_write(&slave->sink, STATUS_INVALID_ARGUMENT,
                  "%zu continuous states are accessed: there are %zu", count,
                  slave_state_count(slave));
    return STATUS_INVALID_ARGUMENT;
}

enum status slave_set_states(struct slave *slave, const double x[], size_t count) {
    const enum status status = check_count(slave, count);
    if (status != STATUS_OK) {
        return status;
    }
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(x[i])) {
            message_write(&slave->sink, STATUS_NOT_FINITE,
                          "state %zu = %g is refused: a finite value is expected", i + 1, x[i]);
            return STATUS_NOT_FINITE;
        }
    }
    if (count > 0) {
        memcpy(doubles_of(slave->memory.values, slave->model->states), x, count * sizeof(double));
    }
    slave->outputs_are_valid = false;
    return STATUS_OK;
}

static enum status copy_finite(const struct slave *slave, const char *what, const double from[],
                               double to[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(from[i])) {
            return slave_not_finite(slave, what);
        }
    }
    if (count > 0) {
        memcpy(to, from, count * sizeof(double));
    }
    return STATUS_OK;
}

enum status slave_get_states(struct slave *slave, double x[], size_t count) {
    const enum status status = check_count(slave, count);
    return status != STATUS_OK
               ? status
               : copy_finite(slave, "a state",
                             doubles_of(slave->memory.values, slave->model->states), x, count);
}

enum status slave_get_derivatives(struct slave *slave, double dx[], size_t count) {
    enum status status = check_count(slave, count);
    if (status == STATUS_OK) {
        status = slave_update_outputs(slave);
    }
    return status != STATUS_OK
               ? status
               : copy_finite(slave, "the derivative of a state",
                             doubles_of(slave->memory.values, slave->model->derivatives), dx,
                             count);
}

enum status slave_get_nominals(struct slave *slave, double nominals[], size_t count) {
    const struct span states = slave->model->states;
    const enum status status = check_count(slave, count);
    for (size_t i = 0; status == STATUS_OK && i < slave->unit->variable_count; i++) {
        const struct variable *variable = &slave->unit->variables[i];
        const size_t from_states = variable->offset - states.offset;
        if (variable->owner == VARIABLE_OF_MODEL && from_states < states.size) {
            nominals[from_states / sizeof(double)] = variable->nominal;
        }
    }
    return status;
}
