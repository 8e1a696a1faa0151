/* Random sequences of all FMI functions with hostile and mixed-up arguments, on several instances
 * of both kinds at once. README.md says how an input is decoded. */
#include "fuzz_instance.h"
#include "fuzz_session.h"

#include "model_description.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

const char *const fuzz_target_name = "fuzz_calls";

enum { MAX_OPERATIONS = 150 };

/* ---- Life and logging ------------------------------------------------------------------------ */

void fuzz_call_GetTypesPlatform(struct fuzz_session *session, struct fuzz_instance *instance) {
    (void)session;
    (void)instance;
    if (strcmp(FUZZ_CALL(fmi2GetTypesPlatform()), fmi2TypesPlatform) != 0) {
        fuzz_fail("fmi2GetTypesPlatform returns another platform");
    }
}

void fuzz_call_GetVersion(struct fuzz_session *session, struct fuzz_instance *instance) {
    (void)session;
    (void)instance;
    if (strcmp(FUZZ_CALL(fmi2GetVersion()), "2.0") != 0) {
        fuzz_fail("fmi2GetVersion returns another version");
    }
}

/* New instances, which are freed at once. */
void fuzz_call_Instantiate(struct fuzz_session *session, struct fuzz_instance *instance) {
    static const char *const names[] = {"", "one", "100 %s %n #r1#\n", "Ä"};
    static const char *const guids[] = {RP_MANIPULATOR_GUID, "", "{0}", "%s%s%s%n"};
    struct fuzz_input *input = session->input;
    const fmi2CallbackFunctions callbacks = fuzz_callbacks(instance, fuzz_below(input, 2) == 0);
    const unsigned name = fuzz_below(input, FUZZ_COUNT(names));
    const unsigned guid = fuzz_below(input, FUZZ_COUNT(guids));
    const int kind = fuzz_below(input, 4) != 0 ? fuzz_byte(input) % 2 : fuzz_integer(input);
    const fmi2Component made = FUZZ_CALL(fmi2Instantiate(
        names[name], (fmi2Type)kind, guids[guid], fuzz_below(input, 2) == 0 ? NULL : names[name],
        &callbacks, fuzz_integer(input), fuzz_integer(input)));
    const bool is_valid =
        name != 0 && guid == 0 && (kind == fmi2CoSimulation || kind == fmi2ModelExchange);
    if ((made != NULL) != is_valid) {
        fuzz_fail("fmi2Instantiate with the name '%s', the GUID '%s' and the kind %d %s",
                  names[name], guids[guid], kind, made != NULL ? "succeeds" : "fails");
    }
    fuzz_instance_count += made != NULL;
    fuzz_call_count++;
    fmi2FreeInstance(made);
}

void fuzz_call_FreeInstance(struct fuzz_session *session, struct fuzz_instance *instance) {
    fuzz_session_free_instance(session, instance);
}

void fuzz_call_SetDebugLogging(struct fuzz_session *session, struct fuzz_instance *instance) {
    static const char *const categories[] = {"logEvents",
                                             "logStatusWarning",
                                             "logStatusDiscard",
                                             "logStatusError",
                                             "logStatusFatal",
                                             "logAll",
                                             "",
                                             "%s%n"};
    struct fuzz_input *input = session->input;
    const size_t count = fuzz_byte(input) % 4;
    fmi2String *chosen = fuzz_array(count, sizeof *chosen);
    for (size_t i = 0; i < count; i++) {
        chosen[i] = categories[fuzz_below(input, FUZZ_COUNT(categories))];
    }
    if (FUZZ_CHECKED(instance, SetDebugLogging, fuzz_byte(input) % 3, count, chosen) == fmi2OK) {
        instance->tells_refusals = false; // it may not have to
    }
    free(chosen);
}

void fuzz_call_SetupExperiment(struct fuzz_session *session, struct fuzz_instance *instance) {
    struct fuzz_input *input = session->input;
    const int tolerance_defined = fuzz_byte(input) % 3;
    const double tolerance = fuzz_real(input);
    const double start = fuzz_real(input);
    const int stop_defined = fuzz_byte(input) % 3;
    const double stop = fuzz_real(input);
    if (FUZZ_CHECKED(instance, SetupExperiment, tolerance_defined, tolerance, start, stop_defined,
                     stop) == fmi2OK) {
        if (!isfinite(start) || (stop_defined && !(stop >= start))) {
            fuzz_fail("an experiment from %g to %g is accepted", start, stop);
        }
        instance->time = start;
    }
}

#define PLAIN_CALL(name)                                                                           \
    void fuzz_call_##name(struct fuzz_session *session, struct fuzz_instance *instance) {          \
        (void)session;                                                                             \
        FUZZ_CHECKED_PLAIN(instance, name);                                                        \
    }
PLAIN_CALL(EnterInitializationMode)
PLAIN_CALL(ExitInitializationMode)
PLAIN_CALL(Terminate)
PLAIN_CALL(CancelStep)
PLAIN_CALL(EnterEventMode)
PLAIN_CALL(EnterContinuousTimeMode)

void fuzz_call_Reset(struct fuzz_session *session, struct fuzz_instance *instance) {
    (void)session;
    fuzz_reset(instance);
}

/* ---- Model Exchange -------------------------------------------------------------------------- */

void fuzz_call_NewDiscreteStates(struct fuzz_session *session, struct fuzz_instance *instance) {
    fmi2EventInfo info = {.nextEventTime = NAN};
    (void)session;
    if (FUZZ_CHECKED(instance, NewDiscreteStates, &info) == fmi2OK &&
        (info.nextEventTimeDefined || info.newDiscreteStatesNeeded || info.terminateSimulation)) {
        fuzz_fail("fmi2NewDiscreteStates reports an event");
    }
}

void fuzz_call_CompletedIntegratorStep(struct fuzz_session *session,
                                       struct fuzz_instance *instance) {
    fmi2Boolean enter = fmi2True;
    fmi2Boolean terminate = fmi2True;
    if (FUZZ_CHECKED(instance, CompletedIntegratorStep, fuzz_integer(session->input), &enter,
                     &terminate) == fmi2OK &&
        (enter || terminate)) {
        fuzz_fail("fmi2CompletedIntegratorStep asks for an event or the end");
    }
}

void fuzz_call_SetTime(struct fuzz_session *session, struct fuzz_instance *instance) {
    const double time = fuzz_real(session->input);
    if (FUZZ_CHECKED(instance, SetTime, time) == fmi2OK) {
        instance->time = time;
    }
}

/* ---- Co-Simulation --------------------------------------------------------------------------- */

static double any_step(struct fuzz_input *input) {
    return fuzz_below(input, 16) != 15 ? fuzz_magnitude(input, 1e-6, 10.0) : fuzz_real(input);
}

void fuzz_call_DoStep(struct fuzz_session *session, struct fuzz_instance *instance) {
    struct fuzz_input *input = session->input;
    const double point = fuzz_below(input, 8) != 7 ? instance->time : fuzz_real(input);
    const double length = any_step(input);
    if (FUZZ_CHECKED(instance, DoStep, point, length, fuzz_integer(input)) == fmi2OK) {
        if (!(length > 0.0) || !isfinite(point + length)) {
            fuzz_fail("a step of %g s from %g s succeeds", length, point);
        }
        instance->time = point + length;
    }
}

static fmi2StatusKind any_status_kind(struct fuzz_input *input) {
    return (fmi2StatusKind)(fuzz_below(input, 8) != 0 ? (int)fuzz_below(input, 4)
                                                      : fuzz_integer(input));
}

void fuzz_call_GetRealStatus(struct fuzz_session *session, struct fuzz_instance *instance) {
    double value = NAN;
    fuzz_poison(&value, 1);
    const fmi2Status status =
        FUZZ_CHECKED(instance, GetRealStatus, any_status_kind(session->input), &value);
    fuzz_assert_written(status, &value, 1, "fmi2GetRealStatus");
}

#define STATUS_CALL(name, type)                                                                    \
    void fuzz_call_##name(struct fuzz_session *session, struct fuzz_instance *instance) {          \
        type value = (type)0;                                                                      \
        FUZZ_CHECKED(instance, name, any_status_kind(session->input), &value);                     \
    }
STATUS_CALL(GetStatus, fmi2Status)
STATUS_CALL(GetIntegerStatus, fmi2Integer)
STATUS_CALL(GetBooleanStatus, fmi2Boolean)
STATUS_CALL(GetStringStatus, fmi2String)

/* ---- Some calls in a row, to come further ---------------------------------------------------- */

static void start_stepping(struct fuzz_session *session, struct fuzz_instance *instance) {
    struct fuzz_input *input = session->input;
    const fmi2ValueReference method_reference = RP_MANIPULATOR_solver_method;
    const fmi2Integer method = 1 + (fmi2Integer)fuzz_below(input, 3);
    const fmi2ValueReference states[] = {RP_MANIPULATOR_q1, RP_MANIPULATOR_q2, RP_MANIPULATOR_dq1,
                                         RP_MANIPULATOR_dq2};
    double values[4];
    fuzz_reset(instance);
    FUZZ_CHECKED(instance, SetInteger, &method_reference, 1, &method);
    for (size_t i = 0; i < FUZZ_COUNT(values); i++) {
        values[i] = fuzz_likely_real(input);
    }
    FUZZ_CHECKED(instance, SetReal, states, FUZZ_COUNT(states), values);
    const double tolerance = fuzz_below(input, 2) == 0 ? 0.0 : fuzz_magnitude(input, 1e-14, 1.0);
    const double start_time = fuzz_below(input, 4) != 0 ? 0.0 : fuzz_real(input);
    if (fuzz_initialize(instance, tolerance, start_time) == fmi2OK &&
        instance->kind == fmi2ModelExchange && fuzz_below(input, 2) == 0) {
        FUZZ_CHECKED_PLAIN(instance, EnterContinuousTimeMode);
    }
}

/* Not of an instance for Model Exchange, mostly: that is an error. */
static bool may_step(struct fuzz_session *session, const struct fuzz_instance *instance) {
    return instance->kind == fmi2CoSimulation || fuzz_below(session->input, 16) == 15;
}

static void step(struct fuzz_session *session, struct fuzz_instance *instance) {
    if (may_step(session, instance)) {
        fuzz_step(instance, any_step(session->input));
    }
}

/* A step, with an input changed or not, and the same again from a state saved before it. */
static void step_twice(struct fuzz_session *session, struct fuzz_instance *instance) {
    if (!may_step(session, instance)) {
        return;
    }
    const double length = any_step(session->input);
    const bool sets_input = fuzz_below(session->input, 2) == 0;
    const fmi2ValueReference input = RP_MANIPULATOR_f2;
    const double effort = sets_input ? fuzz_likely_real(session->input) : 0.0;
    const struct fuzz_instance before = *instance;
    fmi2FMUstate state = NULL;
    struct fuzz_values values[2];
    fmi2Status statuses[2];
    memset(values, 0, sizeof values);
    FUZZ_CHECKED(instance, GetFMUstate, &state);
    for (int i = 0; i < 2; i++) {
        if (sets_input) {
            FUZZ_CHECKED(instance, SetReal, &input, 1, &effort);
        }
        statuses[i] = fuzz_step(instance, length);
        if (statuses[i] != fmi2Error) {
            fuzz_read(instance, &values[i]);
        }
        if (i == 0 && FUZZ_CHECKED(instance, SetFMUstate, state) != fmi2OK) {
            fuzz_fail("an own state cannot be restored");
        }
        if (i == 0) {
            instance->in_error = before.in_error;
            instance->time = before.time;
        }
    }
    if (statuses[0] != statuses[1]) {
        fuzz_fail("a step repeated after a rollback has the status %d, not %d", (int)statuses[1],
                  (int)statuses[0]);
    }
    fuzz_assert_same(&values[0], &values[1], "a step repeated after a rollback");
    FUZZ_CHECKED(instance, FreeFMUstate, &state);
}

static void compare_with_new(struct fuzz_session *session, struct fuzz_instance *instance) {
    fuzz_assert_as_new(instance, fuzz_byte(session->input));
}

/* ---- The target ------------------------------------------------------------------------------ */

/* A function of the standard that is missing here does not compile. */
#define CALL_OF(name) [FMU_##name] = fuzz_call_##name,
static fuzz_operation *const operations[] = {
    FMU_FUNCTION_LIST(CALL_OF)
    // in a row, and what leads further, several times
    start_stepping,
    step,
    step,
    step,
    step,
    step,
    step,
    step,
    step,
    step_twice,
    step_twice,
    step_twice,
    compare_with_new,
    fuzz_call_GetFMUstate,
    fuzz_call_GetFMUstate,
    fuzz_call_SetFMUstate,
    fuzz_call_SetFMUstate,
    fuzz_call_SerializeFMUstate,
    fuzz_call_SerializeFMUstate,
    fuzz_call_DeSerializeFMUstate,
    fuzz_call_DeSerializeFMUstate,
};

/* Most calls lead an instance into the error state, where little is left to be tried. */
static void recover(struct fuzz_session *session, struct fuzz_instance *instance) {
    if (instance->in_error && fuzz_below(session->input, 4) != 0) {
        start_stepping(session, instance);
    }
}

void fuzz_target_run(struct fuzz_input *input) {
    struct fuzz_session session = {.input = input};
    for (int i = 0; i < MAX_OPERATIONS && input->left > 0; i++) {
        fuzz_operation *const chosen = operations[fuzz_byte(input) % FUZZ_COUNT(operations)];
        struct fuzz_instance *instance = fuzz_session_instance(&session);
        recover(&session, instance);
        chosen(&session, instance);
    }
    for (size_t i = 0; i < FUZZ_COUNT(session.instances); i++) {
        struct fuzz_instance *instance = session.instances[i];
        if (instance != NULL && instance->had_error) {
            fuzz_assert_as_new(instance, (unsigned)input->left + (unsigned)i);
        }
    }
    fuzz_session_end(&session);
}
