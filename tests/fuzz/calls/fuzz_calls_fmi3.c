/* Random sequences of all functions of FMI 3.0 with hostile and mixed-up arguments, on several
 * instances of all kinds at once. README.md says how an input is decoded. */
#include "fuzz_arguments.h"
#include "fuzz_bytes.h"
#include "fuzz_fmi3.h"
#include "fuzz_session.h"

#include <math.h>
#include <string.h>

const char *const fuzz_target_name = FUZZ_TARGET_NAME;

/* ---- Intermediate updates -------------------------------------------------------------------- */

static const fmi3ValueReference intermediate[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2,
                                                  RP_MANIPULATOR_ddq1, RP_MANIPULATOR_ee_x};
static const fmi3ValueReference *const outputs = &intermediate[2];
enum { MAX_UPDATES = 20 };

/* What the updates of one step do; no input: nothing. */
static struct {
    struct fuzz_input *input;
    unsigned count;
    bool has_error;
    bool asks_end;
} updates;

static void note(fmi3Status status, const char *what) {
    if (status != fmi3OK && status != fmi3Error) {
        fuzz_fail("%s in an intermediate update has the status %d", what, (int)status);
    }
    updates.has_error |= status == fmi3Error;
}

/* A function that may not be called inside a step. */
static void call_refused(fmi3Instance c, double time) {
    fmi3FMUState state = NULL;
    bool flags[3];
    double reached;
    fmi3Status status = fmi3OK;
    switch (fuzz_below(updates.input, 6)) {
    case 0:
        status = FUZZ_CALL(fmi3Reset(c));
        break;
    case 1:
        status = FUZZ_CALL(fmi3GetFMUState(c, &state));
        break;
    case 2:
        status =
            FUZZ_CALL(fmi3DoStep(c, time, 1.0, true, &flags[0], &flags[1], &flags[2], &reached));
        break;
    case 3:
        status = FUZZ_CALL(fmi3Terminate(c));
        break;
    case 4:
        status = FUZZ_CALL(fmi3EnterEventMode(c));
        break;
    default:
        fuzz_call_count++;
        fmi3FreeInstance(c); // nothing is freed, and the step fails
        updates.has_error = true;
        return;
    }
    if (status != fmi3Error) {
        fuzz_fail("a function that may not be called inside a step has the status %d", (int)status);
    }
    updates.has_error = true;
}

static void set_input(fmi3Instance c, bool may_set) {
    const size_t i = fuzz_below(updates.input, 8);
    const fmi3ValueReference reference =
        i < 7 ? intermediate[i % 2] : (fmi3ValueReference)fuzz_byte(updates.input);
    const double value = fuzz_likely_real(updates.input);
    const fmi3Status status = FUZZ_CALL(fmi3SetFloat64(c, &reference, 1, &value, 1));
    note(status, "fmi3SetFloat64");
    if (status == fmi3OK && !(may_set && isfinite(value))) {
        fuzz_fail("an intermediate update accepts %g", value);
    }
}

static void get_outputs(fmi3Instance c, bool may_get) {
    const bool are_derivatives = fuzz_below(updates.input, 4) == 0;
    const size_t count = 1 + fuzz_below(updates.input, are_derivatives ? 2 : 4);
    const fmi3Int32 orders[] = {1, (fmi3Int32)fuzz_below(updates.input, 4)};
    double values[FUZZ_COUNT(intermediate)];
    fuzz_poison(values, count);
    const fmi3Status status =
        are_derivatives
            ? FUZZ_CALL(fmi3GetOutputDerivatives(c, outputs, count, orders, values, count))
            : FUZZ_CALL(fmi3GetFloat64(c, intermediate, count, values, count));
    note(status, "fmi3GetFloat64");
    fuzz_assert_written((fmi2Status)status, values, count, "an intermediate update");
    if (status == fmi3OK && !may_get) {
        fuzz_fail("an intermediate update gives values before the step");
    }
}

static void update(fmi3InstanceEnvironment environment, fmi3Float64 time, fmi3Boolean set,
                   fmi3Boolean get, fmi3Boolean finished, fmi3Boolean can_return_early,
                   fmi3Boolean *return_early, fmi3Float64 *early_time) {
    struct fuzz_instance *instance = environment;
    const fmi3Instance c = fmu_fmi3_instance(instance->component);
    if (set == get || finished != get || !isfinite(time)) {
        fuzz_fail("an intermediate update at %g s may set: %d, get: %d, finished: %d", time, set,
                  get, finished);
    }
    if (updates.input == NULL || updates.count++ >= MAX_UPDATES) {
        return;
    }
    const unsigned selector = fuzz_byte(updates.input);
    if (selector % 8 < 5) {
        if (set) {
            set_input(c, true);
        } else {
            get_outputs(c, true);
        }
    } else if (selector >= 252) {
        call_refused(c, time);
    } else if (selector >= 246) {
        set_input(c, set);
        get_outputs(c, get);
    }
    if (selector % 16 == 1) { // where it must not be asked for, too
        *return_early = true;
        *early_time = selector < 128 ? time : fuzz_real(updates.input);
        updates.asks_end |= can_return_early;
    }
}

/* ---- Life ------------------------------------------------------------------------------------ */

static void log_text(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                     fmi3String message) {
    fuzz_callbacks(environment, true)
        .logger(environment, "", (fmi2Status)status, category, message);
}

/* New instances, which are freed at once. */
static void instantiate(struct fuzz_session *session, struct fuzz_instance *instance,
                        enum fmu3_function function) {
    static const char *const names[] = {"", "one", "100 %s %n #r1#\n", "Ä"};
    static const char *const tokens[] = {RP_MANIPULATOR_TOKEN_FMI3, "", RP_MANIPULATOR_GUID,
                                         "%s%s%s%n"};
    struct fuzz_input *input = session->input;
    const fmi3LogMessageCallback logger = fuzz_below(input, 2) == 0 ? log_text : NULL;
    const unsigned name = fuzz_below(input, FUZZ_COUNT(names));
    const unsigned token = fuzz_below(input, FUZZ_COUNT(tokens));
    const bool logging_on = fuzz_below(input, 2) == 0;
    fmi3Instance made = NULL;
    bool is_valid = name != 0 && token == 0;
    fuzz_call_count++;
    if (function == FMU3_InstantiateModelExchange) {
        made = fmi3InstantiateModelExchange(names[name], tokens[token], NULL, false, logging_on,
                                            instance, logger);
    } else if (function == FMU3_InstantiateCoSimulation) {
        fmi3ValueReference required[2];
        const size_t count = fuzz_below(input, 3);
        for (size_t i = 0; i < count; i++) {
            const unsigned selector = fuzz_byte(input);
            required[i] = selector < 192 ? intermediate[selector % FUZZ_COUNT(intermediate)]
                                         : RP_MANIPULATOR_g;
            is_valid = is_valid && selector < 192;
        }
        const unsigned flags = fuzz_byte(input);
        made = fmi3InstantiateCoSimulation(names[name], tokens[token], names[name], true,
                                           logging_on, flags & 1, flags & 2, required, count,
                                           instance, logger, flags & 4 ? update : NULL);
    } else {
        made = fmi3InstantiateScheduledExecution(names[name], tokens[token], NULL, false,
                                                 logging_on, instance, logger, NULL, NULL, NULL);
        is_valid = false;
    }
    if ((made != NULL) != is_valid) {
        fuzz_fail("%s with the name '%s' and the token '%s' %s", fmu3_function_names[function],
                  names[name], tokens[token], made != NULL ? "succeeds" : "fails");
    }
    fuzz_instance_count += made != NULL;
    fuzz_call_count++;
    fmi3FreeInstance(made);
}

#define INSTANTIATE_CALL(name)                                                                     \
    void fuzz3_call_##name(struct fuzz_session *session, struct fuzz_instance *instance) {         \
        instantiate(session, instance, FMU3_##name);                                               \
    }
INSTANTIATE_CALL(InstantiateModelExchange)
INSTANTIATE_CALL(InstantiateCoSimulation)
INSTANTIATE_CALL(InstantiateScheduledExecution)

/* ---- Modes ----------------------------------------------------------------------------------- */

void fuzz3_call_EnterInitializationMode(struct fuzz_session *session,
                                        struct fuzz_instance *instance) {
    struct fuzz_input *input = session->input;
    const bool tolerance_defined = fuzz_below(input, 2) == 0;
    const double tolerance = fuzz_real(input);
    const double start = fuzz_real(input);
    const bool stop_defined = fuzz_below(input, 2) == 0;
    const double stop = fuzz_real(input);
    if (FUZZ_FMI3_CHECKED(instance, EnterInitializationMode, tolerance_defined, tolerance, start,
                          stop_defined, stop) == fmi2OK) {
        if (!isfinite(start) || (stop_defined && !(stop >= start))) {
            fuzz_fail("an experiment from %g to %g is accepted", start, stop);
        }
        instance->time = start;
    }
}

void fuzz3_call_ExitInitializationMode(struct fuzz_session *session,
                                       struct fuzz_instance *instance) {
    FUZZ_FMI3_CHECKED_PLAIN(instance, ExitInitializationMode);
}

void fuzz3_call_EnterStepMode(struct fuzz_session *session, struct fuzz_instance *instance) {
    if (FUZZ_FMI3_CHECKED_PLAIN(instance, EnterStepMode) == fmi2OK &&
        !(instance->variety & FUZZ_EVENT_MODE)) {
        fuzz_fail("fmi3EnterStepMode succeeds without event mode");
    }
}

#define NUMBER_CALL(name, expected)                                                                \
    void fuzz3_call_##name(struct fuzz_session *session, struct fuzz_instance *instance) {         \
        size_t count = 99;                                                                         \
        if (FUZZ_FMI3_CALL(instance, true, name, &count) == fmi2OK && count != (expected)) {       \
            fuzz_fail("fmi3" #name " returns %zu", count);                                         \
        }                                                                                          \
    }
NUMBER_CALL(GetNumberOfEventIndicators, 0)
NUMBER_CALL(GetNumberOfContinuousStates, 4)

/* ---- Steps ----------------------------------------------------------------------------------- */

void fuzz3_call_DoStep(struct fuzz_session *session, struct fuzz_instance *instance) {
    struct fuzz_input *input = session->input;
    const double point = fuzz_below(input, 8) != 7 ? instance->time : fuzz_real(input);
    const double length = fuzz_any_step(input);
    static struct fuzz_bytes before;
    static struct fuzz_bytes after;
    bool event = true;
    bool terminate = true;
    bool early = true;
    double reached;
    fuzz_poison(&reached, 1);
    fuzz_serialize(instance, &before);
    memset(&updates, 0, sizeof updates);
    updates.input = input;
    const fmi2Status status =
        FUZZ_FMI3_CHECKED(instance, DoStep, point, length, fuzz_below(input, 2) == 0, &event,
                          &terminate, &early, &reached);
    updates.input = NULL;
    fuzz_assert_written(status, &reached, 1, "fmi3DoStep");
    if (updates.has_error && status != fmi2Error) {
        fuzz_fail("a step has the status %d after an error inside it", (int)status);
    }
    if (status == fmi2Discard) {
        fuzz_serialize(instance, &after);
        if (!fuzz_are_same_bytes(&before, &after)) {
            fuzz_fail("a discarded step of %g s from %g s has changed the instance", length, point);
        }
    }
    if (status != fmi2OK) {
        return;
    }
    if (!(length > 0.0) || !isfinite(point + length) || event || terminate) {
        fuzz_fail("a step of %g s from %g s succeeds, event: %d, end: %d", length, point, event,
                  terminate);
    }
    if (early != (reached < point + length) || (early && !updates.asks_end) ||
        reached > point + length || reached < instance->time) {
        fuzz_fail("a step of %g s from %g s, early: %d, has reached %g s", length, point, early,
                  reached);
    }
    instance->time = reached;
}

/* ---- The target ------------------------------------------------------------------------------ */

static void choose_variety(unsigned variety) {
    const struct fmu_fmi3_options none = {0};
    const struct fmu_fmi3_options chosen = {
        .event_mode = variety & FUZZ_EVENT_MODE,
        .early_return = variety & FUZZ_EARLY_RETURN,
        .update = variety & FUZZ_UPDATES ? update : NULL,
        .required = intermediate,
        .required_count = FUZZ_COUNT(intermediate),
    };
    fmu_fmi3_options = variety != 0 ? chosen : none;
}

#define SAME(name, of)                                                                             \
    void fuzz3_call_##name(struct fuzz_session *session, struct fuzz_instance *instance) {         \
        fuzz_call_##of(session, instance);                                                         \
    }
SAME(GetVersion, GetVersion)
SAME(SetDebugLogging, SetDebugLogging)
SAME(FreeInstance, FreeInstance)
SAME(EnterEventMode, EnterEventMode)
SAME(Terminate, Terminate)
SAME(Reset, Reset)
SAME(GetFloat64, GetReal)
SAME(SetFloat64, SetReal)
SAME(GetInt32, GetInteger)
SAME(SetInt32, SetInteger)
SAME(GetFMUState, GetFMUstate)
SAME(SetFMUState, SetFMUstate)
SAME(FreeFMUState, FreeFMUstate)
SAME(SerializedFMUStateSize, SerializedFMUstateSize)
SAME(SerializeFMUState, SerializeFMUstate)
SAME(DeserializeFMUState, DeSerializeFMUstate)
SAME(GetDirectionalDerivative, GetDirectionalDerivative)
SAME(UpdateDiscreteStates, NewDiscreteStates)
SAME(EnterContinuousTimeMode, EnterContinuousTimeMode)
SAME(CompletedIntegratorStep, CompletedIntegratorStep)
SAME(SetTime, SetTime)
SAME(SetContinuousStates, SetContinuousStates)
SAME(GetContinuousStateDerivatives, GetDerivatives)
SAME(GetEventIndicators, GetEventIndicators)
SAME(GetContinuousStates, GetContinuousStates)
SAME(GetNominalsOfContinuousStates, GetNominalsOfContinuousStates)
SAME(GetOutputDerivatives, GetRealOutputDerivatives)

/* A function of the standard that is missing does not link. */
#define CALL_OF(name, kinds, states) fuzz3_call_##name,
static fuzz_operation *const calls[] = {FMI3_FUNCTION_LIST(CALL_OF)};

void fuzz_target_run(struct fuzz_input *input) {
    fuzz_choose_variety = choose_variety;
    fuzz_session_run(input, calls, FMU3_FUNCTION_COUNT);
}
