/* Calls that set and get values: variables by reference, states and derivatives, with arguments as
 * the input says. */
#include "fuzz_session.h"

#include "model_description.h"

#include <math.h>
#include <stdlib.h>

/* ---- Arguments ------------------------------------------------------------------------------- */

/* Mostly one of this type, and of those that can be set between steps where one is to be set. */
static fmi2ValueReference any_reference(struct fuzz_input *input, enum variable_type type,
                                        bool sets) {
    const unsigned selector = fuzz_byte(input);
    if (selector >= 248) {
        return selector < 252 ? 9 * (selector - 247) : (fmi2ValueReference)fuzz_word(input);
    }
    const struct variable *variable =
        &model_description.variables[selector % model_description.variable_count];
    for (size_t i = 0; i < model_description.variable_count && selector < 216; i++) {
        variable = &model_description.variables[(selector + i) % model_description.variable_count];
        if (variable->type == type && (!sets || variable_is_settable(variable, PHASE_STEPPING))) {
            break;
        }
    }
    return variable->reference;
}

/* Mostly few, mostly not none. */
static size_t any_count(struct fuzz_input *input) {
    const unsigned selector = fuzz_byte(input);
    return selector < 160 ? 1 : selector % 8;
}

static fmi2ValueReference *any_references(struct fuzz_input *input, size_t count,
                                          enum variable_type type, bool sets) {
    fmi2ValueReference *references = fuzz_array(count, sizeof *references);
    for (size_t i = 0; i < count; i++) {
        references[i] = any_reference(input, type, sets);
    }
    return references;
}

static double *any_reals(struct fuzz_input *input, size_t count) {
    double *values = fuzz_array(count, sizeof *values);
    for (size_t i = 0; i < count; i++) {
        values[i] = fuzz_likely_real(input);
    }
    return values;
}

static fmi2Integer *any_integers(struct fuzz_input *input, size_t count) {
    fmi2Integer *values = fuzz_array(count, sizeof *values);
    for (size_t i = 0; i < count; i++) {
        values[i] = fuzz_integer(input);
    }
    return values;
}

static fmi2Integer *any_orders(struct fuzz_input *input, size_t count) {
    fmi2Integer *orders = fuzz_array(count, sizeof *orders);
    for (size_t i = 0; i < count; i++) {
        const unsigned selector = fuzz_byte(input);
        orders[i] = selector < 230 ? (fmi2Integer)(selector % 5) : fuzz_integer(input);
    }
    return orders;
}

static double *unwritten(size_t count) {
    double *values = fuzz_array(count, sizeof *values);
    fuzz_poison(values, count);
    return values;
}

/* ---- Values ---------------------------------------------------------------------------------- */

void fuzz_call_GetReal(struct fuzz_session *session, struct fuzz_instance *instance) {
    const size_t count = any_count(session->input);
    fmi2ValueReference *references = any_references(session->input, count, VARIABLE_FLOAT64, false);
    double *values = unwritten(count);
    const fmi2Status status = FUZZ_CHECKED(instance, GetReal, references, count, values);
    fuzz_assert_written(status, values, count, "fmi2GetReal");
    free(references);
    free(values);
}

void fuzz_call_SetReal(struct fuzz_session *session, struct fuzz_instance *instance) {
    const size_t count = any_count(session->input);
    fmi2ValueReference *references = any_references(session->input, count, VARIABLE_FLOAT64, true);
    double *values = any_reals(session->input, count);
    if (FUZZ_CHECKED(instance, SetReal, references, count, values) == fmi2OK) {
        for (size_t i = 0; i < count; i++) {
            if (!isfinite(values[i])) {
                fuzz_fail("fmi2SetReal accepts %g", values[i]);
            }
        }
    }
    free(references);
    free(values);
}

#define GETTER_OF_VALUES(type, variables)                                                          \
    void fuzz_call_Get##type(struct fuzz_session *session, struct fuzz_instance *instance) {       \
        const size_t count = any_count(session->input);                                            \
        fmi2ValueReference *references = any_references(session->input, count, variables, false);  \
        fmi2##type *values = fuzz_array(count, sizeof *values);                                    \
        FUZZ_CHECKED(instance, Get##type, references, count, values);                              \
        free(references);                                                                          \
        free(values);                                                                              \
    }
GETTER_OF_VALUES(Integer, VARIABLE_INT32)
GETTER_OF_VALUES(Boolean, VARIABLE_FLOAT64)
GETTER_OF_VALUES(String, VARIABLE_FLOAT64)

void fuzz_call_SetInteger(struct fuzz_session *session, struct fuzz_instance *instance) {
    const size_t count = any_count(session->input);
    fmi2ValueReference *references = any_references(session->input, count, VARIABLE_INT32, true);
    fmi2Integer *values = any_integers(session->input, count);
    for (size_t i = 0; i < count; i++) {
        if (references[i] == RP_MANIPULATOR_max_internal_steps &&
            values[i] > FUZZ_MAX_INTERNAL_STEPS) {
            values[i] = FUZZ_MAX_INTERNAL_STEPS;
        } else if (references[i] == RP_MANIPULATOR_solver_method && values[i] > 0) {
            values[i] %= 5;
        }
    }
    FUZZ_CHECKED(instance, SetInteger, references, count, values);
    free(references);
    free(values);
}

void fuzz_call_SetBoolean(struct fuzz_session *session, struct fuzz_instance *instance) {
    const size_t count = any_count(session->input);
    fmi2ValueReference *references = any_references(session->input, count, VARIABLE_FLOAT64, true);
    fmi2Boolean *values = any_integers(session->input, count);
    FUZZ_CHECKED(instance, SetBoolean, references, count, values);
    free(references);
    free(values);
}

void fuzz_call_SetString(struct fuzz_session *session, struct fuzz_instance *instance) {
    const size_t count = any_count(session->input);
    fmi2ValueReference *references = any_references(session->input, count, VARIABLE_FLOAT64, true);
    fmi2String *values = fuzz_array(count, sizeof *values);
    for (size_t i = 0; i < count; i++) {
        values[i] = "%s%n";
    }
    FUZZ_CHECKED(instance, SetString, references, count, values);
    free(references);
    free(values);
}

void fuzz_call_GetDirectionalDerivative(struct fuzz_session *session,
                                        struct fuzz_instance *instance) {
    const size_t unknowns = any_count(session->input);
    const size_t knowns = any_count(session->input);
    fmi2ValueReference *unknown = any_references(session->input, unknowns, VARIABLE_FLOAT64, false);
    fmi2ValueReference *known = any_references(session->input, knowns, VARIABLE_FLOAT64, false);
    double *seed = any_reals(session->input, knowns);
    double *result = unwritten(unknowns);
    const fmi2Status status = FUZZ_CHECKED(instance, GetDirectionalDerivative, unknown, unknowns,
                                           known, knowns, seed, result);
    fuzz_assert_written(status, result, unknowns, "fmi2GetDirectionalDerivative");
    free(unknown);
    free(known);
    free(seed);
    free(result);
}

/* ---- States and derivatives of Model Exchange ------------------------------------------------ */

/* Mostly the right number of states. */
static size_t state_count(struct fuzz_input *input) {
    const unsigned selector = fuzz_byte(input);
    return selector < 200 ? 4 : selector % 8;
}

void fuzz_call_SetContinuousStates(struct fuzz_session *session, struct fuzz_instance *instance) {
    const size_t count = state_count(session->input);
    double *values = any_reals(session->input, count);
    FUZZ_CHECKED(instance, SetContinuousStates, values, count);
    free(values);
}

#define GETTER_OF_STATES(name)                                                                     \
    void fuzz_call_##name(struct fuzz_session *session, struct fuzz_instance *instance) {          \
        const size_t count = state_count(session->input);                                          \
        double *values = unwritten(count);                                                         \
        const fmi2Status status = FUZZ_CHECKED(instance, name, values, count);                     \
        fuzz_assert_written(status, values, count, "fmi2" #name);                                  \
        free(values);                                                                              \
    }
GETTER_OF_STATES(GetDerivatives)
GETTER_OF_STATES(GetEventIndicators)
GETTER_OF_STATES(GetContinuousStates)
GETTER_OF_STATES(GetNominalsOfContinuousStates)

/* ---- Derivatives of inputs and outputs ------------------------------------------------------- */

void fuzz_call_SetRealInputDerivatives(struct fuzz_session *session,
                                       struct fuzz_instance *instance) {
    const size_t count = any_count(session->input);
    fmi2ValueReference *references = any_references(session->input, count, VARIABLE_FLOAT64, true);
    if (count > 0 && fuzz_below(session->input, 4) != 0) {
        references[0] = RP_MANIPULATOR_tau1;
    }
    fmi2Integer *orders = any_orders(session->input, count);
    double *values = any_reals(session->input, count);
    FUZZ_CHECKED(instance, SetRealInputDerivatives, references, count, orders, values);
    free(references);
    free(orders);
    free(values);
}

void fuzz_call_GetRealOutputDerivatives(struct fuzz_session *session,
                                        struct fuzz_instance *instance) {
    const size_t count = any_count(session->input);
    fmi2ValueReference *references = any_references(session->input, count, VARIABLE_FLOAT64, false);
    fmi2Integer *orders = any_orders(session->input, count);
    double *values = unwritten(count);
    const fmi2Status status =
        FUZZ_CHECKED(instance, GetRealOutputDerivatives, references, count, orders, values);
    fuzz_assert_written(status, values, count, "fmi2GetRealOutputDerivatives");
    free(references);
    free(orders);
    free(values);
}
