#include "derivatives.h"

#include "state.h"
#include "values.h"

#include <math.h>
#include <string.h>

/* Returns the variable if it serves; otherwise NULL, with a message that says which kind is
 * expected. */
static const struct variable *
find_as(const struct instance *instance, unsigned reference,
        bool (*serves)(const struct instance *, const struct variable *), const char *expected) {
    const struct variable *variable = variable_find(instance->description, reference);
    if (variable == NULL) {
        return instance_refuse_reference(instance, reference, VARIABLE_FLOAT64);
    }
    if (variable->type != VARIABLE_FLOAT64) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "%s (value reference %u) is refused: it is of type %s, %s of type float64 is "
                      "expected",
                      variable->name, reference, variable_type_name(variable->type), expected);
        return NULL;
    }
    if (!serves(instance, variable)) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "%s (value reference %u) is refused: %s is expected", variable->name,
                      reference, expected);
        return NULL;
    }
    return variable;
}

/* ---- Derivatives with respect to time ------------------------------------------------------- */

static bool is_continuous_input(const struct instance *instance, const struct variable *variable) {
    return variable->causality == CAUSALITY_INPUT &&
           variable->variability == VARIABILITY_CONTINUOUS;
}

static bool is_output(const struct instance *instance, const struct variable *variable) {
    return variable->causality == CAUSALITY_OUTPUT && variable->owner == VARIABLE_OF_MODEL;
}

static enum status check_order(const struct instance *instance, const struct variable *variable,
                               int order, int largest) {
    if (order >= 1 && order <= largest) {
        return STATUS_OK;
    }
    message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                  "derivative of %s of order %d is refused: an order from 1 to %d is expected",
                  variable->name, order, largest);
    return STATUS_INVALID_ARGUMENT;
}

enum status instance_set_input_derivatives(struct instance *instance, const unsigned references[],
                                           size_t count, const int orders[],
                                           const double values[]) {
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable =
            find_as(instance, references[i], is_continuous_input, "a continuous input");
        if (variable == NULL) {
            return STATUS_INVALID_ARGUMENT;
        }
        const enum status status = check_order(instance, variable, orders[i], POLYNOMIAL_DEGREE);
        if (status != STATUS_OK) {
            return status;
        }
        if (!isfinite(values[i])) {
            message_write(&instance->sink, STATUS_NOT_FINITE,
                          "derivative %g of %s is refused: a finite value is expected", values[i],
                          variable->name);
            return STATUS_NOT_FINITE;
        }
    }
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable = variable_of(instance->description, references[i]);
        const size_t input = instance_input_index(instance, variable);
        struct polynomial *next = &instance->memory.next_inputs[input];
        next->d[orders[i]] = values[i];
        instance->inputs_are_held = false;
        // from now on outputs use the input of the next step, as after instance_set_real
        instance->memory.current_inputs[input] = *next;
        doubles_of(instance->memory.values, instance->model->inputs)[input] = next->d[0];
        instance->outputs_are_valid = false;
    }
    return STATUS_OK;
}

/* Writes the derivatives of all calculated values to instance->first_derivatives and second, which
 * may be NULL. */
static enum status derive(struct instance *instance, double dt, char *second) {
    const double t = instance->state.time.s;
    const enum status status = instance->model->derivatives(instance->memory.values, t, dt,
                                                            instance->first_derivatives, second);
    if (status != STATUS_OK) {
        message_write(&instance->sink, status, "no derivatives at t = %.17g: %s", t,
                      status_text(status));
    }
    return status;
}

/* Writes the known derivatives of this order by time: the inputs' and the states', which a value
 * structure of the order below has calculated. */
static void begin_by_time(const struct instance *instance, int order, char *below,
                          char *derivatives) {
    const struct model *model = instance->model;
    memset(derivatives, 0, model->values_size);
    memcpy(doubles_of(derivatives, model->states), doubles_of(below, model->dx),
           model->states.size);
    for (size_t i = 0; i < count_of(model->inputs); i++) {
        doubles_of(derivatives, model->inputs)[i] = instance->memory.current_inputs[i].d[order];
    }
}

/* Derives twice along the motion: the states' derivatives are calculated values, whose own
 * derivatives are the next ones of the states. */
static enum status derive_by_time(struct instance *instance) {
    enum status status = instance_update_outputs(instance);
    if (status != STATUS_OK) {
        return status;
    }
    begin_by_time(instance, 1, instance->memory.values, instance->first_derivatives);
    status = derive(instance, 1.0, NULL);
    if (status != STATUS_OK) {
        return status;
    }
    begin_by_time(instance, 2, instance->first_derivatives, instance->second_derivatives);
    return derive(instance, 1.0, instance->second_derivatives);
}

/* Returns the derivative of a variable, from a value structure of derivatives; 0 for variables of
 * the instance, such as counters, which are constant between events. */
static double derivative_in(const char *structure, const struct variable *variable) {
    return variable->owner == VARIABLE_OF_MODEL
               ? *(const double *)(const void *)(structure + variable->offset)
               : 0.0;
}

enum status instance_get_output_derivatives(struct instance *instance, const unsigned references[],
                                            size_t count, const int orders[], double values[]) {
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable = find_as(instance, references[i], is_output, "an output");
        if (variable == NULL) {
            return STATUS_INVALID_ARGUMENT;
        }
        const enum status status = check_order(instance, variable, orders[i], 2);
        if (status != STATUS_OK) {
            return status;
        }
    }
    const enum status status = count > 0 ? derive_by_time(instance) : STATUS_OK;
    if (status != STATUS_OK) {
        return status;
    }
    for (int writing = 0; writing < 2; writing++) {
        for (size_t i = 0; i < count; i++) {
            const struct variable *variable = variable_of(instance->description, references[i]);
            const double value = derivative_in(orders[i] == 1 ? instance->first_derivatives
                                                              : instance->second_derivatives,
                                               variable);
            if (!isfinite(value)) {
                return instance_not_finite(instance, variable->name);
            }
            if (writing) {
                values[i] = value;
            }
        }
    }
    return STATUS_OK;
}

/* ---- Derivatives with respect to other variables -------------------------------------------- */

static bool is_unknown(const struct instance *instance, const struct variable *variable) {
    return (variable->owner == VARIABLE_OF_MODEL ||
            variable->variability == VARIABILITY_DISCRETE) &&
           (variable->causality == CAUSALITY_OUTPUT || variable->causality == CAUSALITY_LOCAL);
}

static bool is_time(const struct variable *variable) {
    return variable->causality == CAUSALITY_INDEPENDENT;
}

static bool is_moving(const struct instance *instance, const struct variable *variable) {
    if (variable->owner != VARIABLE_OF_MODEL || variable->variability == VARIABILITY_DISCRETE) {
        return instance_is_kept_number(instance, variable);
    }
    return variable->causality == CAUSALITY_INPUT || instance_is_state(instance, variable) ||
           (variable->causality == CAUSALITY_PARAMETER &&
            instance->state.phase == PHASE_INITIALIZATION);
}

static bool is_argument(const struct instance *instance, const struct variable *variable) {
    return is_moving(instance, variable) || is_time(variable) ||
           (variable->owner == VARIABLE_OF_MODEL && variable->causality == CAUSALITY_PARAMETER);
}

/* Checks the variables of rows and columns, and brings the outputs up to date. */
static enum status prepare_matrix(struct instance *instance, enum known_kinds kinds,
                                  const unsigned unknowns[], size_t unknown_count,
                                  const unsigned knowns[], size_t known_count) {
    for (size_t i = 0; i < unknown_count; i++) {
        if (find_as(instance, unknowns[i], is_unknown, "an output, a local or a derivative") ==
            NULL) {
            return STATUS_INVALID_ARGUMENT;
        }
    }
    for (size_t i = 0; i < known_count; i++) {
        const struct variable *known =
            kinds == KNOWN_MOTION
                ? find_as(instance, knowns[i], is_moving,
                          "an input, a state, a discrete variable with a start value or, in "
                          "initialization mode, a parameter")
                : find_as(instance, knowns[i], is_argument,
                          "an input, a state, a parameter or the time");
        if (known == NULL) {
            return STATUS_INVALID_ARGUMENT;
        }
    }
    return instance_update_outputs(instance);
}

static double *double_in(char *structure, const struct variable *variable) {
    return (double *)(void *)(structure + variable->offset);
}

/* Checks that the value and its derivative are finite. direction: name of the direction of the
 * derivative, for a message. */
static enum status check_derivative(const struct instance *instance, const struct variable *unknown,
                                    const char *direction) {
    if (unknown->owner == VARIABLE_OF_MODEL &&
        !isfinite(derivative_in(instance->memory.values, unknown))) {
        return instance_not_finite(instance, unknown->name);
    }
    if (!isfinite(derivative_in(instance->first_derivatives, unknown))) {
        message_write(&instance->sink, STATUS_NOT_FINITE,
                      "the derivative of %s by %s at t = %.17g is not finite", unknown->name,
                      direction, instance->state.time.s);
        return STATUS_NOT_FINITE;
    }
    return STATUS_OK;
}

/* Returns the name of the variable that a direction is along, or a text for several. */
static const char *direction_name(const struct instance *instance, const unsigned knowns[],
                                  size_t count, const double v[]) {
    const char *name = "nothing";
    size_t moving = 0;
    for (size_t i = 0; i < count; i++) {
        if (v[i] != 0.0) {
            name = variable_of(instance->description, knowns[i])->name;
            moving++;
        }
    }
    return moving > 1 ? "all that moves" : name;
}

enum status instance_get_directional_derivative(struct instance *instance, enum known_kinds kinds,
                                                const unsigned unknowns[], size_t unknown_count,
                                                const unsigned knowns[], size_t known_count,
                                                const double v[], double result[]) {
    enum status status =
        prepare_matrix(instance, kinds, unknowns, unknown_count, knowns, known_count);
    if (status != STATUS_OK) {
        return status;
    }

    memset(instance->first_derivatives, 0, instance->model->values_size);
    double dt = 0.0;
    for (size_t i = 0; i < known_count; i++) {
        const struct variable *variable = variable_of(instance->description, knowns[i]);
        *(is_time(variable) ? &dt : double_in(instance->first_derivatives, variable)) += v[i];
    }
    status = derive(instance, dt, NULL);
    if (status != STATUS_OK) {
        return status;
    }
    const char *direction = direction_name(instance, knowns, known_count, v);
    for (size_t i = 0; status == STATUS_OK && i < unknown_count; i++) {
        status =
            check_derivative(instance, variable_of(instance->description, unknowns[i]), direction);
    }
    for (size_t i = 0; status == STATUS_OK && i < unknown_count; i++) {
        const struct variable *variable = variable_of(instance->description, unknowns[i]);
        result[i] = derivative_in(instance->first_derivatives, variable);
    }
    return status;
}

/* Writes the product of v^T and the column of J of one known. */
static enum status multiply_column(struct instance *instance, const unsigned unknowns[],
                                   size_t unknown_count, const struct variable *known,
                                   const double v[], double *product) {
    memset(instance->first_derivatives, 0, instance->model->values_size);
    double dt = 0.0;
    *(is_time(known) ? &dt : double_in(instance->first_derivatives, known)) = 1.0;
    enum status status = derive(instance, dt, NULL);
    *product = 0.0;
    for (size_t i = 0; status == STATUS_OK && i < unknown_count; i++) {
        const struct variable *unknown = variable_of(instance->description, unknowns[i]);
        if (v[i] != 0.0) {
            status = check_derivative(instance, unknown, known->name);
            *product += v[i] * derivative_in(instance->first_derivatives, unknown);
        }
    }
    if (status == STATUS_OK && !isfinite(*product)) {
        return instance_not_finite(instance, known->name);
    }
    return status;
}

enum status instance_get_adjoint_derivative(struct instance *instance, enum known_kinds kinds,
                                            const unsigned unknowns[], size_t unknown_count,
                                            const unsigned knowns[], size_t known_count,
                                            const double v[], double result[]) {
    enum status status =
        prepare_matrix(instance, kinds, unknowns, unknown_count, knowns, known_count);
    // nothing is written to result before all derivatives have succeeded
    double by_time = 0.0;
    for (size_t i = 0; status == STATUS_OK && i < known_count; i++) {
        const struct variable *known = variable_of(instance->description, knowns[i]);
        status = multiply_column(instance, unknowns, unknown_count, known, v,
                                 is_time(known) ? &by_time
                                                : double_in(instance->second_derivatives, known));
    }
    for (size_t i = 0; status == STATUS_OK && i < known_count; i++) {
        const struct variable *known = variable_of(instance->description, knowns[i]);
        result[i] = is_time(known) ? by_time : *double_in(instance->second_derivatives, known);
    }
    return status;
}
