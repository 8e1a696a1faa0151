/* Calls that set and get values: variables by reference, states and derivatives, with arguments as
 * the input says. */
#include "fuzz_arguments.h"
#include "fuzz_session.h"

#include <math.h>
#include <stdlib.h>

/* ---- Values ---------------------------------------------------------------------------------- */

void fuzz_call_GetReal(struct fuzz_session *session, struct fuzz_instance *instance) {
    const size_t count = fuzz_any_count(session->input);
    fmi2ValueReference *references =
        fuzz_any_references(session->input, count, VARIABLE_FLOAT64, false);
    double *values = fuzz_unwritten(count);
    const fmi2Status status = FUZZ_CHECKED(instance, GetReal, references, count, values);
    fuzz_assert_written(status, values, count, "fmi2GetReal");
    free(references);
    free(values);
}

void fuzz_call_SetReal(struct fuzz_session *session, struct fuzz_instance *instance) {
    const size_t count = fuzz_any_count(session->input);
    fmi2ValueReference *references =
        fuzz_any_references(session->input, count, VARIABLE_FLOAT64, true);
    double *values = fuzz_any_reals(session->input, count);
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
        const size_t count = fuzz_any_count(session->input);                                       \
        fmi2ValueReference *references =                                                           \
            fuzz_any_references(session->input, count, variables, false);                          \
        fmi2##type *values = fuzz_array(count, sizeof *values);                                    \
        FUZZ_CHECKED(instance, Get##type, references, count, values);                              \
        free(references);                                                                          \
        free(values);                                                                              \
    }
GETTER_OF_VALUES(Integer, VARIABLE_INT32)
GETTER_OF_VALUES(Boolean, VARIABLE_FLOAT64)
GETTER_OF_VALUES(String, VARIABLE_FLOAT64)

void fuzz_call_SetInteger(struct fuzz_session *session, struct fuzz_instance *instance) {
    const size_t count = fuzz_any_count(session->input);
    fmi2ValueReference *references =
        fuzz_any_references(session->input, count, VARIABLE_INT32, true);
    fmi2Integer *values = fuzz_any_integers(session->input, count);
    for (size_t i = 0; i < count; i++) {
        if (references[i] == RP_MANIPULATOR_max_internal_steps &&
            values[i] > FUZZ_MAX_INTERNAL_STEPS) {
            values[i] = FUZZ_MAX_INTERNAL_STEPS;
        } else if (references[i] == RP_MANIPULATOR_solver_method && values[i] > 0) {
            values[i] %= FUZZ_METHODS + 2;
        }
    }
    FUZZ_CHECKED(instance, SetInteger, references, count, values);
    free(references);
    free(values);
}

void fuzz_call_SetBoolean(struct fuzz_session *session, struct fuzz_instance *instance) {
    const size_t count = fuzz_any_count(session->input);
    fmi2ValueReference *references =
        fuzz_any_references(session->input, count, VARIABLE_FLOAT64, true);
    fmi2Boolean *values = fuzz_any_integers(session->input, count);
    FUZZ_CHECKED(instance, SetBoolean, references, count, values);
    free(references);
    free(values);
}

void fuzz_call_SetString(struct fuzz_session *session, struct fuzz_instance *instance) {
    const size_t count = fuzz_any_count(session->input);
    fmi2ValueReference *references =
        fuzz_any_references(session->input, count, VARIABLE_FLOAT64, true);
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
    const size_t unknowns = fuzz_any_count(session->input);
    const size_t knowns = fuzz_any_count(session->input);
    fmi2ValueReference *unknown =
        fuzz_any_references(session->input, unknowns, VARIABLE_FLOAT64, false);
    fmi2ValueReference *known =
        fuzz_any_references(session->input, knowns, VARIABLE_FLOAT64, false);
    double *seed = fuzz_any_reals(session->input, knowns);
    double *result = fuzz_unwritten(unknowns);
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
    double *values = fuzz_any_reals(session->input, count);
    FUZZ_CHECKED(instance, SetContinuousStates, values, count);
    free(values);
}

#define GETTER_OF_STATES(name)                                                                     \
    void fuzz_call_##name(struct fuzz_session *session, struct fuzz_instance *instance) {          \
        const size_t count = state_count(session->input);                                          \
        double *values = fuzz_unwritten(count);                                                    \
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
    const size_t count = fuzz_any_count(session->input);
    fmi2ValueReference *references =
        fuzz_any_references(session->input, count, VARIABLE_FLOAT64, true);
    if (count > 0 && fuzz_below(session->input, 4) != 0) {
        references[0] = RP_MANIPULATOR_tau1;
    }
    fmi2Integer *orders = fuzz_any_orders(session->input, count);
    double *values = fuzz_any_reals(session->input, count);
    FUZZ_CHECKED(instance, SetRealInputDerivatives, references, count, orders, values);
    free(references);
    free(orders);
    free(values);
}

void fuzz_call_GetRealOutputDerivatives(struct fuzz_session *session,
                                        struct fuzz_instance *instance) {
    const size_t count = fuzz_any_count(session->input);
    fmi2ValueReference *references =
        fuzz_any_references(session->input, count, VARIABLE_FLOAT64, false);
    fmi2Integer *orders = fuzz_any_orders(session->input, count);
    double *values = fuzz_unwritten(count);
    const fmi2Status status =
        FUZZ_CHECKED(instance, GetRealOutputDerivatives, references, count, orders, values);
    fuzz_assert_written(status, values, count, "fmi2GetRealOutputDerivatives");
    free(references);
    free(orders);
    free(values);
}
