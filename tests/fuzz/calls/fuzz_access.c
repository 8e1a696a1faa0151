/* Calls that set and get values: variables by reference, states and derivatives, with arguments as
 * the input says. */
#include "fuzz_arguments.h"
#include "fuzz_session.h"

#include <math.h>

/* ---- Values ---------------------------------------------------------------------------------- */

void fuzz_call_GetReal(struct fuzz_session *session, struct fuzz_instance *instance) {
    const struct fuzz_references some = fuzz_any(session->input, VARIABLE_FLOAT64, false);
    double *values = fuzz_unwritten(some.count);
    const fmi2Status status = FUZZ_CHECKED(instance, GetReal, some.at, some.count, values);
    fuzz_assert_written(status, values, some.count, "fmi2GetReal");
}

void fuzz_call_SetReal(struct fuzz_session *session, struct fuzz_instance *instance) {
    const struct fuzz_references some = fuzz_any(session->input, VARIABLE_FLOAT64, true);
    const double *values = fuzz_any_reals(session->input, some.count);
    const fmi2Status status = FUZZ_CHECKED(instance, SetReal, some.at, some.count, values);
    for (size_t i = 0; i < some.count && status == fmi2OK; i++) {
        if (!isfinite(values[i])) {
            fuzz_fail("fmi2SetReal accepts %g", values[i]);
        }
    }
}

#define GETTER_OF_VALUES(type, variables)                                                          \
    void fuzz_call_Get##type(struct fuzz_session *session, struct fuzz_instance *instance) {       \
        const struct fuzz_references some = fuzz_any(session->input, variables, false);            \
        fmi2##type *values = fuzz_argument(some.count, sizeof *values);                            \
        FUZZ_CHECKED(instance, Get##type, some.at, some.count, values);                            \
    }
GETTER_OF_VALUES(Integer, VARIABLE_INT32)
GETTER_OF_VALUES(Boolean, VARIABLE_FLOAT64)
GETTER_OF_VALUES(String, VARIABLE_FLOAT64)

void fuzz_call_SetInteger(struct fuzz_session *session, struct fuzz_instance *instance) {
    const struct fuzz_references some = fuzz_any(session->input, VARIABLE_INT32, true);
    fmi2Integer *values = fuzz_any_integers(session->input, some.count);
    for (size_t i = 0; i < some.count; i++) {
        if (some.at[i] == RP_MANIPULATOR_max_internal_steps &&
            values[i] > FUZZ_MAX_INTERNAL_STEPS) {
            values[i] = FUZZ_MAX_INTERNAL_STEPS;
        } else if (some.at[i] == RP_MANIPULATOR_solver_method && values[i] > 0) {
            values[i] %= FUZZ_METHODS + 2;
        }
    }
    FUZZ_CHECKED(instance, SetInteger, some.at, some.count, values);
}

void fuzz_call_SetBoolean(struct fuzz_session *session, struct fuzz_instance *instance) {
    const struct fuzz_references some = fuzz_any(session->input, VARIABLE_FLOAT64, true);
    const fmi2Boolean *values = fuzz_any_integers(session->input, some.count);
    FUZZ_CHECKED(instance, SetBoolean, some.at, some.count, values);
}

void fuzz_call_SetString(struct fuzz_session *session, struct fuzz_instance *instance) {
    const struct fuzz_references some = fuzz_any(session->input, VARIABLE_FLOAT64, true);
    fmi2String *values = fuzz_argument(some.count, sizeof *values);
    for (size_t i = 0; i < some.count; i++) {
        values[i] = "%s%n";
    }
    FUZZ_CHECKED(instance, SetString, some.at, some.count, values);
}

void fuzz_call_GetDirectionalDerivative(struct fuzz_session *session,
                                        struct fuzz_instance *instance) {
    struct fuzz_references unknowns;
    struct fuzz_references knowns;
    fuzz_any_pair(session->input, false, &unknowns, &knowns);
    const double *seed = fuzz_any_reals(session->input, knowns.count);
    double *result = fuzz_unwritten(unknowns.count);
    const fmi2Status status = FUZZ_CHECKED(instance, GetDirectionalDerivative, unknowns.at,
                                           unknowns.count, knowns.at, knowns.count, seed, result);
    fuzz_assert_written(status, result, unknowns.count, "fmi2GetDirectionalDerivative");
}

/* ---- States and derivatives of Model Exchange ------------------------------------------------ */

/* Mostly the right number of states. */
static size_t state_count(struct fuzz_input *input) {
    const unsigned selector = fuzz_byte(input);
    return selector < 200 ? 4 : selector % 8;
}

void fuzz_call_SetContinuousStates(struct fuzz_session *session, struct fuzz_instance *instance) {
    const size_t count = state_count(session->input);
    const double *values = fuzz_any_reals(session->input, count);
    FUZZ_CHECKED(instance, SetContinuousStates, values, count);
}

#define GETTER_OF_STATES(name)                                                                     \
    void fuzz_call_##name(struct fuzz_session *session, struct fuzz_instance *instance) {          \
        const size_t count = state_count(session->input);                                          \
        double *values = fuzz_unwritten(count);                                                    \
        const fmi2Status status = FUZZ_CHECKED(instance, name, values, count);                     \
        fuzz_assert_written(status, values, count, "fmi2" #name);                                  \
    }
GETTER_OF_STATES(GetDerivatives)
GETTER_OF_STATES(GetEventIndicators)
GETTER_OF_STATES(GetContinuousStates)
GETTER_OF_STATES(GetNominalsOfContinuousStates)

/* ---- Derivatives of inputs and outputs ------------------------------------------------------- */

void fuzz_call_SetRealInputDerivatives(struct fuzz_session *session,
                                       struct fuzz_instance *instance) {
    const struct fuzz_references some = fuzz_any(session->input, VARIABLE_FLOAT64, true);
    if (some.count > 0 && fuzz_below(session->input, 4) != 0) {
        some.at[0] = RP_MANIPULATOR_tau1;
    }
    const fmi2Integer *orders = fuzz_any_orders(session->input, some.count);
    const double *values = fuzz_any_reals(session->input, some.count);
    FUZZ_CHECKED(instance, SetRealInputDerivatives, some.at, some.count, orders, values);
}

void fuzz_call_GetRealOutputDerivatives(struct fuzz_session *session,
                                        struct fuzz_instance *instance) {
    const struct fuzz_references some = fuzz_any(session->input, VARIABLE_FLOAT64, false);
    const fmi2Integer *orders = fuzz_any_orders(session->input, some.count);
    double *values = fuzz_unwritten(some.count);
    const fmi2Status status =
        FUZZ_CHECKED(instance, GetRealOutputDerivatives, some.at, some.count, orders, values);
    fuzz_assert_written(status, values, some.count, "fmi2GetRealOutputDerivatives");
}
