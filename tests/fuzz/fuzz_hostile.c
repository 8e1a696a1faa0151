/* Any model: any function in any state, with hostile arguments. Whatever is called, a state that
 * was saved before leads back. */
#include "fuzz_hostile.h"

#include "fuzz_model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Internal steps that one communication step may take here, so that executions are quick. */
enum { MAX_INTERNAL_STEPS = 300 };

/* ---- Arguments ------------------------------------------------------------------------------- */

static void *arguments[8];
static size_t argument_count;

void *fuzz_argument(size_t count, size_t size) {
    if (argument_count == FUZZ_COUNT(arguments)) {
        fuzz_fail("a call has more arguments than %zu", argument_count);
    }
    return arguments[argument_count++] = fuzz_array(count, size);
}

static void free_arguments(void) {
    while (argument_count > 0) {
        free(arguments[--argument_count]);
    }
}

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

struct fuzz_references fuzz_any(struct fuzz_input *input, enum variable_type type, bool sets) {
    const unsigned selector = fuzz_byte(input);
    struct fuzz_references some = {.count = selector < 160 ? 1 : selector % 8};
    some.size = selector % 32 == 31 ? fuzz_below(input, 8) : some.count;
    some.at = fuzz_argument(some.count, sizeof *some.at);
    for (size_t i = 0; i < some.count; i++) {
        some.at[i] = any_reference(input, type, sets);
    }
    return some;
}

double *fuzz_any_reals(struct fuzz_input *input, size_t count) {
    double *values = fuzz_argument(count, sizeof *values);
    for (size_t i = 0; i < count; i++) {
        values[i] = fuzz_likely_real(input);
    }
    return values;
}

fmi2Integer *fuzz_any_orders(struct fuzz_input *input, size_t count) {
    fmi2Integer *orders = fuzz_argument(count, sizeof *orders);
    for (size_t i = 0; i < count; i++) {
        const unsigned selector = fuzz_byte(input);
        orders[i] = selector < 230 ? (fmi2Integer)(selector % 5) : fuzz_integer(input);
    }
    return orders;
}

double *fuzz_unwritten(size_t count) {
    double *values = fuzz_argument(count, sizeof *values);
    fuzz_poison(values, count);
    return values;
}

double fuzz_any_point(struct fuzz_input *input, const struct fuzz_instance *instance) {
    return fuzz_below(input, 8) != 7 ? instance->time : fuzz_real(input);
}

double fuzz_any_length(struct fuzz_input *input) {
    return fuzz_below(input, 16) != 15 ? fuzz_magnitude(input, 1e-6, 10.0) : fuzz_real(input);
}

/* ---- Modes ----------------------------------------------------------------------------------- */

static void SetDebugLogging(struct fuzz_input *input, struct fuzz_instance *instance) {
    static const char *const categories[] = {"logEvents",
                                             "logStatusWarning",
                                             "logStatusDiscard",
                                             "logStatusError",
                                             "logStatusFatal",
                                             "logAll",
                                             "",
                                             "%s%n"};
    const size_t count = fuzz_below(input, 4);
    fmi2String *chosen = fuzz_argument(count, sizeof *chosen);
    for (size_t i = 0; i < count; i++) {
        chosen[i] = categories[fuzz_below(input, FUZZ_COUNT(categories))];
    }
    if (FUZZ_CHECKED(instance, SetDebugLogging, fuzz_byte(input) % 3, count, chosen) == fmi2OK) {
        instance->tells_refusals = false; // it may not have to
    }
}

/* Calls SetupExperiment, then mostly EnterInitializationMode: in FMI 3.0 they are one call. */
static void EnterInitializationMode(struct fuzz_input *input, struct fuzz_instance *instance) {
    const int tolerance_defined = fuzz_byte(input) % 3;
    const double tolerance = fuzz_real(input);
    const double start = fuzz_real(input);
    const int stop_defined = fuzz_byte(input) % 3;
    const double stop = fuzz_real(input);
    fmi2Status status = FUZZ_CHECKED(instance, SetupExperiment, tolerance_defined, tolerance, start,
                                     stop_defined, stop);
    if (status == fmi2OK && fuzz_below(input, 4) != 0) {
        status = FUZZ_CHECKED_PLAIN(instance, EnterInitializationMode);
        if (status == fmi2OK && (!isfinite(start) || (stop_defined && !(stop >= start)))) {
            fuzz_fail("an experiment from %g to %g is accepted", start, stop);
        }
        instance->time = status == fmi2OK ? start : instance->time;
    }
}

/* Resets, then may enter initialization mode, and may exit it. */
static void Reset(struct fuzz_input *input, struct fuzz_instance *instance) {
    fuzz_reset(instance);
    fuzz_limit_steps(instance, MAX_INTERNAL_STEPS);
    const unsigned steps = fuzz_below(input, 4);
    if (steps > 0) {
        EnterInitializationMode(input, instance);
    }
    if (steps > 1) {
        FUZZ_CHECKED_PLAIN(instance, ExitInitializationMode);
    }
}

#define PLAIN_CALL(name)                                                                           \
    static void name(struct fuzz_input *input, struct fuzz_instance *instance) {                   \
        FUZZ_CHECKED_PLAIN(instance, name);                                                        \
    }
PLAIN_CALL(ExitInitializationMode)
PLAIN_CALL(Terminate)
PLAIN_CALL(EnterEventMode)
PLAIN_CALL(EnterContinuousTimeMode)

static void NewDiscreteStates(struct fuzz_input *input, struct fuzz_instance *instance) {
    fmi2EventInfo info = {.nextEventTime = NAN};
    if (FUZZ_CHECKED(instance, NewDiscreteStates, &info) == fmi2OK &&
        (info.terminateSimulation ||
         (info.nextEventTimeDefined && !isfinite(info.nextEventTime)))) {
        fuzz_fail("fmi2NewDiscreteStates asks for the end: %d, or has the next event at %g s",
                  info.terminateSimulation, info.nextEventTime);
    }
}

static void CompletedIntegratorStep(struct fuzz_input *input, struct fuzz_instance *instance) {
    fmi2Boolean enter = fmi2True;
    fmi2Boolean terminate = fmi2True;
    if (FUZZ_CHECKED(instance, CompletedIntegratorStep, fuzz_integer(input), &enter, &terminate) ==
            fmi2OK &&
        (terminate || (enter && model_description.indicator_count == 0))) {
        fuzz_fail("fmi2CompletedIntegratorStep asks for %d %d", enter, terminate);
    }
}

static void SetTime(struct fuzz_input *input, struct fuzz_instance *instance) {
    const double time = fuzz_real(input);
    if (FUZZ_CHECKED(instance, SetTime, time) == fmi2OK) {
        instance->time = time;
    }
}

/* ---- Values ---------------------------------------------------------------------------------- */

static void GetReal(struct fuzz_input *input, struct fuzz_instance *instance) {
    const struct fuzz_references some = fuzz_any(input, VARIABLE_FLOAT64, false);
    double *values = fuzz_unwritten(some.count);
    const fmi2Status status = FUZZ_CHECKED(instance, GetReal, some.at, some.count, values);
    fuzz_assert_written(status, values, some.count, "fmi2GetReal");
}

static void SetReal(struct fuzz_input *input, struct fuzz_instance *instance) {
    const struct fuzz_references some = fuzz_any(input, VARIABLE_FLOAT64, true);
    const double *values = fuzz_any_reals(input, some.count);
    const fmi2Status status = FUZZ_CHECKED(instance, SetReal, some.at, some.count, values);
    for (size_t i = 0; i < some.count && status == fmi2OK; i++) {
        if (!isfinite(values[i])) {
            fuzz_fail("fmi2SetReal accepts %g", values[i]);
        }
    }
}

#define GETTER_OF_VALUES(type, variables)                                                          \
    static void Get##type(struct fuzz_input *input, struct fuzz_instance *instance) {              \
        const struct fuzz_references some = fuzz_any(input, variables, false);                     \
        fmi2##type *values = fuzz_argument(some.count, sizeof *values);                            \
        FUZZ_CHECKED(instance, Get##type, some.at, some.count, values);                            \
    }
GETTER_OF_VALUES(Integer, VARIABLE_INT32)
GETTER_OF_VALUES(Boolean, VARIABLE_BOOLEAN)
GETTER_OF_VALUES(String, VARIABLE_FLOAT64) // no variable is a String

/* Limits of the work stay low, and most items of enumerations exist. */
static int any_integer(struct fuzz_input *input, fmi2ValueReference reference) {
    enum { MOST_ITEMS = 4 };
    const int value = fuzz_integer(input);
    for (size_t i = 0; i < model_description.variable_count; i++) {
        const struct variable *variable = &model_description.variables[i];
        if (variable->reference == reference && variable->type == VARIABLE_ENUMERATION) {
            return value % (MOST_ITEMS + 2);
        }
        if (variable->reference == reference && variable->owner == VARIABLE_OF_INSTANCE) {
            return value < MAX_INTERNAL_STEPS ? value : MAX_INTERNAL_STEPS;
        }
    }
    return value;
}

#define SETTER_OF_VALUES(type, variables, value)                                                   \
    static void Set##type(struct fuzz_input *input, struct fuzz_instance *instance) {              \
        const struct fuzz_references some = fuzz_any(input, variables, true);                      \
        fmi2##type *values = fuzz_argument(some.count, sizeof *values);                            \
        for (size_t i = 0; i < some.count; i++) {                                                  \
            values[i] = value;                                                                     \
        }                                                                                          \
        FUZZ_CHECKED(instance, Set##type, some.at, some.count, values);                            \
    }
SETTER_OF_VALUES(Integer, VARIABLE_INT32, any_integer(input, some.at[i]))
SETTER_OF_VALUES(Boolean, VARIABLE_BOOLEAN, fuzz_integer(input))
SETTER_OF_VALUES(String, VARIABLE_FLOAT64, "%s%n") // no variable is a String

/* ---- States and derivatives ------------------------------------------------------------------ */

/* Mostly the right number. */
static size_t any_count(struct fuzz_input *input, size_t right) {
    const unsigned selector = fuzz_byte(input);
    return selector < 200 ? right : selector % 8;
}

static void SetContinuousStates(struct fuzz_input *input, struct fuzz_instance *instance) {
    const size_t count = any_count(input, fuzz_state_count());
    const double *values = fuzz_any_reals(input, count);
    FUZZ_CHECKED(instance, SetContinuousStates, values, count);
}

#define GETTER_OF_STATES(name, right)                                                              \
    static void name(struct fuzz_input *input, struct fuzz_instance *instance) {                   \
        const size_t count = any_count(input, right);                                              \
        double *values = fuzz_unwritten(count);                                                    \
        const fmi2Status status = FUZZ_CHECKED(instance, name, values, count);                     \
        fuzz_assert_written(status, values, count, "fmi2" #name);                                  \
        if (status == fmi2OK && count != (right)) {                                                \
            fuzz_fail("fmi2" #name " gives %zu values of %zu", count, (size_t)(right));            \
        }                                                                                          \
    }
GETTER_OF_STATES(GetDerivatives, fuzz_state_count())
GETTER_OF_STATES(GetEventIndicators, model_description.indicator_count)
GETTER_OF_STATES(GetContinuousStates, fuzz_state_count())
GETTER_OF_STATES(GetNominalsOfContinuousStates, fuzz_state_count())

static void GetDirectionalDerivative(struct fuzz_input *input, struct fuzz_instance *instance) {
    const struct fuzz_references unknowns = fuzz_any(input, VARIABLE_FLOAT64, false);
    const struct fuzz_references knowns = fuzz_any(input, VARIABLE_FLOAT64, false);
    const double *seed = fuzz_any_reals(input, knowns.count);
    double *result = fuzz_unwritten(unknowns.count);
    const fmi2Status status = FUZZ_CHECKED(instance, GetDirectionalDerivative, unknowns.at,
                                           unknowns.count, knowns.at, knowns.count, seed, result);
    fuzz_assert_written(status, result, unknowns.count, "fmi2GetDirectionalDerivative");
}

static void GetRealOutputDerivatives(struct fuzz_input *input, struct fuzz_instance *instance) {
    const struct fuzz_references some = fuzz_any(input, VARIABLE_FLOAT64, false);
    const fmi2Integer *orders = fuzz_any_orders(input, some.count);
    double *values = fuzz_unwritten(some.count);
    const fmi2Status status =
        FUZZ_CHECKED(instance, GetRealOutputDerivatives, some.at, some.count, orders, values);
    fuzz_assert_written(status, values, some.count, "fmi2GetRealOutputDerivatives");
}

/* All bytes of a serialized state are accepted, a part of them never. */
static void DeSerializeFMUstate(struct fuzz_input *input, struct fuzz_instance *instance) {
    static struct fuzz_bytes bytes;
    fmi2FMUstate state = NULL;
    fuzz_serialize(instance, &bytes);
    const unsigned selector = fuzz_byte(input);
    const size_t size = selector < 128 ? bytes.size : bytes.size * (selector % 128) / 128;
    fmi2Byte *copy = fuzz_argument(size > 0 ? size : 1, 1); // nothing lies behind them
    memcpy(copy, bytes.data, size);
    const fmi2Status status = FUZZ_CHECKED(instance, DeSerializeFMUstate, copy, size, &state);
    if ((status == fmi2OK) != (size == bytes.size) || (state != NULL) != (status == fmi2OK)) {
        fuzz_fail("fmi2DeSerializeFMUstate of %zu bytes of %zu has the status %d", size, bytes.size,
                  (int)status);
    }
    if (state != NULL) {
        fuzz_forget(instance, &state);
    }
}

/* ---- Any of them ----------------------------------------------------------------------------- */

static fuzz_hostile_call *const calls[] = {
    SetDebugLogging,
    EnterInitializationMode,
    ExitInitializationMode,
    Reset,
    Terminate,
    EnterEventMode,
    EnterContinuousTimeMode,
    NewDiscreteStates,
    CompletedIntegratorStep,
    SetTime,
    GetReal,
    SetReal,
    GetInteger,
    SetInteger,
    GetBoolean,
    SetBoolean,
    GetString,
    SetString,
    SetContinuousStates,
    GetDerivatives,
    GetEventIndicators,
    GetContinuousStates,
    GetNominalsOfContinuousStates,
    GetDirectionalDerivative,
    GetRealOutputDerivatives,
    DeSerializeFMUstate,
};

void fuzz_model_call_anything(struct subject *subject) {
    static struct fuzz_bytes bytes[2];
    struct fuzz_input *input = subject->input;
    struct fuzz_instance *instance = subject->instance;
    const double time = instance->time;
    const unsigned count = 1 + fuzz_below(input, 16);
    fmi2FMUstate state = fuzz_save(instance);
    fuzz_serialize(instance, &bytes[0]);
    for (unsigned i = 0; i < count; i++) {
        if (instance->in_error && fuzz_below(input, 4) != 0) {
            fuzz_restore(instance, state, time); // little is left to be tried after an error
        }
        const size_t number = fuzz_byte(input) % (FUZZ_COUNT(calls) + fuzz_version_calls.count);
        fuzz_hostile_call *const chosen =
            number < FUZZ_COUNT(calls) ? calls[number]
                                       : fuzz_version_calls.calls[number - FUZZ_COUNT(calls)];
        chosen(input, instance);
        free_arguments();
    }
    fuzz_restore(instance, state, time);
    fuzz_serialize(instance, &bytes[1]);
    if (!fuzz_are_same_bytes(&bytes[0], &bytes[1])) {
        fuzz_fail("hostile calls leave a trace after a rollback");
    }
    fuzz_forget(instance, &state);
}
