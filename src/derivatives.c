/* Derivatives of an instance's values: with respect to time, and to other variables. */
#include "slave_state.h"

#include <math.h>
#include <string.h>

/* The variable, or NULL with a text that says for what it would have to serve. */
static const struct variable *find_as(const struct slave *slave, unsigned reference,
                                      bool (*serves)(const struct slave *, const struct variable *),
                                      const char *expected) {
    const struct variable *variable = slave_find(slave, reference, VARIABLE_REAL);
    if (variable != NULL && !serves(slave, variable)) {
        message_write(&slave->sink, STATUS_INVALID_ARGUMENT,
                      "%s (value reference %u) is refused: %s is expected", variable->name,
                      reference, expected);
        return NULL;
    }
    return variable;
}

/* ---- Derivatives with respect to time ------------------------------------------------------- */

static bool is_continuous_input(const struct slave *slave, const struct variable *variable) {
    (void)slave;
    return variable->causality == CAUSALITY_INPUT &&
           variable->variability == VARIABILITY_CONTINUOUS;
}

static bool is_output(const struct slave *slave, const struct variable *variable) {
    (void)slave;
    return variable->causality == CAUSALITY_OUTPUT && variable->owner == VARIABLE_OF_MODEL;
}

static enum status check_order(const struct slave *slave, const struct variable *variable,
                               int order, int largest) {
    if (order >= 1 && order <= largest) {
        return STATUS_OK;
    }
    message_write(&slave->sink, STATUS_INVALID_ARGUMENT,
                  "derivative of %s of order %d is refused: an order from 1 to %d is expected",
                  variable->name, order, largest);
    return STATUS_INVALID_ARGUMENT;
}

enum status slave_set_input_derivatives(struct slave *slave, const unsigned references[],
                                        size_t count, const int orders[], const double values[]) {
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable =
            find_as(slave, references[i], is_continuous_input, "a continuous input");
        if (variable == NULL) {
            return STATUS_INVALID_ARGUMENT;
        }
        const enum status status = check_order(slave, variable, orders[i], POLYNOMIAL_DEGREE);
        if (status != STATUS_OK) {
            return status;
        }
        if (!isfinite(values[i])) {
            message_write(&slave->sink, STATUS_NOT_FINITE,
                          "derivative %g of %s is refused: a finite value is expected", values[i],
                          variable->name);
            return STATUS_NOT_FINITE;
        }
    }
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable = variable_of(slave->unit, references[i]);
        const size_t input = slave_input_index(slave, variable);
        struct polynomial *pending = &slave->memory.pending[input];
        pending->d[orders[i]] = values[i];
        // from now on outputs answer for the input of the next step, as after slave_set_real
        slave->memory.current[input] = *pending;
        doubles_of(slave->memory.values, slave->model->inputs)[input] = pending->d[0];
        slave->outputs_are_valid = false;
    }
    return STATUS_OK;
}

/* Of all calculated values, into slave->first and second, which may be NULL. */
static enum status propagate(struct slave *slave, double dt, char *second) {
    const double t = slave->state.time.s;
    const enum status status =
        slave->model->propagate(slave->memory.values, t, dt, slave->first, second);
    if (status != STATUS_OK) {
        message_write(&slave->sink, status, "no derivatives at t = %.17g: %s", t,
                      status_text(status));
    }
    return status;
}

/* Derivatives along the motion, twice: those of the states are calculated values, whose own
 * derivatives are the states' next ones. */
static enum status derive_by_time(struct slave *slave) {
    const struct model *model = slave->model;
    const struct slave_memory *memory = &slave->memory;
    enum status status = slave_update_outputs(slave);
    if (status != STATUS_OK) {
        return status;
    }

    memset(slave->first, 0, model->values_size);
    memcpy(doubles_of(slave->first, model->states), doubles_of(memory->values, model->derivatives),
           model->states.size);
    for (size_t i = 0; i < count_of(model->inputs); i++) {
        doubles_of(slave->first, model->inputs)[i] = memory->current[i].d[1];
    }
    status = propagate(slave, 1.0, NULL);
    if (status != STATUS_OK) {
        return status;
    }

    memset(slave->second, 0, model->values_size);
    memcpy(doubles_of(slave->second, model->states), doubles_of(slave->first, model->derivatives),
           model->states.size);
    for (size_t i = 0; i < count_of(model->inputs); i++) {
        doubles_of(slave->second, model->inputs)[i] = memory->current[i].d[2];
    }
    return propagate(slave, 1.0, slave->second);
}

static double value_in(const char *structure, const struct variable *variable) {
    return *(const double *)(const void *)(structure + variable->offset);
}

enum status slave_get_output_derivatives(struct slave *slave, const unsigned references[],
                                         size_t count, const int orders[], double values[]) {
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable =
            find_as(slave, references[i], is_output, "an output of type Real");
        if (variable == NULL) {
            return STATUS_INVALID_ARGUMENT;
        }
        const enum status status = check_order(slave, variable, orders[i], 2);
        if (status != STATUS_OK) {
            return status;
        }
    }
    const enum status status = count > 0 ? derive_by_time(slave) : STATUS_OK;
    if (status != STATUS_OK) {
        return status;
    }
    for (int writing = 0; writing < 2; writing++) {
        for (size_t i = 0; i < count; i++) {
            const struct variable *variable = variable_of(slave->unit, references[i]);
            const double value = value_in(orders[i] == 1 ? slave->first : slave->second, variable);
            if (!isfinite(value)) {
                return slave_not_finite(slave, variable->name);
            }
            if (writing) {
                values[i] = value;
            }
        }
    }
    return STATUS_OK;
}

/* ---- Derivatives with respect to other variables -------------------------------------------- */

static bool is_unknown(const struct slave *slave, const struct variable *variable) {
    (void)slave;
    return variable->owner == VARIABLE_OF_MODEL &&
           (variable->causality == CAUSALITY_OUTPUT || variable->causality == CAUSALITY_LOCAL);
}

static bool is_known(const struct slave *slave, const struct variable *variable) {
    if (variable->owner != VARIABLE_OF_MODEL) {
        return false;
    }
    const size_t from_states = variable->offset - slave->model->states.offset;
    return variable->causality == CAUSALITY_INPUT || from_states < slave->model->states.size ||
           (variable->causality == CAUSALITY_PARAMETER &&
            slave->state.phase == PHASE_INITIALIZATION);
}

enum status slave_get_directional_derivative(struct slave *slave, const unsigned unknowns[],
                                             size_t unknown_count, const unsigned knowns[],
                                             size_t known_count, const double v[],
                                             double result[]) {
    for (size_t i = 0; i < unknown_count; i++) {
        if (find_as(slave, unknowns[i], is_unknown, "an output, a local or a derivative") == NULL) {
            return STATUS_INVALID_ARGUMENT;
        }
    }
    for (size_t i = 0; i < known_count; i++) {
        if (find_as(slave, knowns[i], is_known,
                    "an input, a state or, in initialization mode, a parameter") == NULL) {
            return STATUS_INVALID_ARGUMENT;
        }
    }
    enum status status = slave_update_outputs(slave);
    if (status != STATUS_OK) {
        return status;
    }

    memset(slave->first, 0, slave->model->values_size);
    for (size_t i = 0; i < known_count; i++) {
        const struct variable *variable = variable_of(slave->unit, knowns[i]);
        *(double *)(void *)(slave->first + variable->offset) += v[i];
    }
    status = propagate(slave, 0.0, NULL);
    if (status != STATUS_OK) {
        return status;
    }
    for (int writing = 0; writing < 2; writing++) {
        for (size_t i = 0; i < unknown_count; i++) {
            const struct variable *variable = variable_of(slave->unit, unknowns[i]);
            const double value = value_in(slave->first, variable);
            if (!isfinite(value)) {
                return slave_not_finite(slave, variable->name);
            }
            if (writing) {
                result[i] = value;
            }
        }
    }
    return STATUS_OK;
}
