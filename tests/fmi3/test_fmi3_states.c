/* Which function works in which state: FMI 3.0, sections 2.3, 3.2 and 4.2. */
#include "fmu3_harness.h"

#include <stdio.h>
#include <string.h>
#include <unity.h>

/* ---- One call of any function ------------------------------------------------------------------
 */

static const double calls_step = 0.01; // s

static const fmi3ValueReference q1 = RP_MANIPULATOR_q1;
static const fmi3ValueReference tau1 = RP_MANIPULATOR_tau1;
static const fmi3ValueReference ddq1 = RP_MANIPULATOR_ddq1;
static const fmi3Int32 order = 1;
static const double one = 1.0;
static const double zeros[FMU_STATES];

// where results go
static bool flags[5];
static double reals[FMU_STATES];
static size_t count;

/* ---- With these arguments ------------------------------------------------------------------- */

#define CALL_PLAIN(name)                                                                           \
    static fmi3Status call_##name(fmi3Instance c, double now) {                                    \
        return fmu3.name(c);                                                                       \
    }
#define CALL(name, ...)                                                                            \
    static fmi3Status call_##name(fmi3Instance c, double now) {                                    \
        return fmu3.name(c, __VA_ARGS__);                                                          \
    }
CALL(SetDebugLogging, false, 0, NULL)
CALL(EnterInitializationMode, true, 1e-6, 0.0, true, 100.0)
CALL_PLAIN(ExitInitializationMode)
CALL_PLAIN(EnterEventMode)
CALL_PLAIN(Terminate)
CALL_PLAIN(Reset)
CALL(FreeFMUState, &(fmi3FMUState){NULL})
CALL(GetDirectionalDerivative, &ddq1, 1, &tau1, 1, &one, 1, reals, 1)
CALL(GetAdjointDerivative, &ddq1, 1, &tau1, 1, &one, 1, reals, 1)
CALL(UpdateDiscreteStates, &flags[0], &flags[1], &flags[2], &flags[3], &flags[4], reals)
CALL(GetFloat64, &q1, 1, reals, 1)
CALL(SetFloat64, &tau1, 1, &one, 1)

/* No value: of these types there is no variable, or none that is accessed in all states of the row.
 */
#define NO_VALUE(type)                                                                             \
    CALL(Get##type, NULL, 0, NULL, 0)                                                              \
    CALL(Set##type, NULL, 0, NULL, 0)
NO_VALUE(Float32)
NO_VALUE(Int8)
NO_VALUE(UInt8)
NO_VALUE(Int16)
NO_VALUE(UInt16)
NO_VALUE(Int32)
NO_VALUE(UInt32)
NO_VALUE(Int64)
NO_VALUE(UInt64)
NO_VALUE(Boolean)
NO_VALUE(String)
CALL(GetBinary, NULL, 0, NULL, NULL, 0)
CALL(SetBinary, NULL, 0, NULL, NULL, 0)

// Model Exchange
CALL_PLAIN(EnterContinuousTimeMode)
CALL(CompletedIntegratorStep, true, &flags[0], &flags[1])
CALL(SetTime, now)
CALL(SetContinuousStates, zeros, FMU_STATES)
CALL(GetContinuousStateDerivatives, reals, FMU_STATES)
CALL(GetEventIndicators, reals, 0)
CALL(GetContinuousStates, reals, FMU_STATES)
CALL(GetNominalsOfContinuousStates, reals, FMU_STATES)
CALL(GetNumberOfEventIndicators, &count)
CALL(GetNumberOfContinuousStates, &count)

// Co-Simulation
CALL_PLAIN(EnterStepMode)
CALL(GetOutputDerivatives, &q1, 1, &order, reals, 1)

// clocks, configuration, dependencies: refused whatever the arguments are
CALL(GetClock, NULL, 0, NULL)
CALL(SetClock, NULL, 0, NULL)
CALL(GetIntervalDecimal, NULL, 0, NULL, NULL)
CALL(GetIntervalFraction, NULL, 0, NULL, NULL, NULL)
CALL(GetShiftDecimal, NULL, 0, NULL)
CALL(GetShiftFraction, NULL, 0, NULL, NULL)
CALL(SetIntervalDecimal, NULL, 0, NULL)
CALL(SetIntervalFraction, NULL, 0, NULL, NULL)
CALL(SetShiftDecimal, NULL, 0, NULL)
CALL(SetShiftFraction, NULL, 0, NULL, NULL)
CALL_PLAIN(EvaluateDiscreteStates)
CALL_PLAIN(EnterConfigurationMode)
CALL_PLAIN(ExitConfigurationMode)
CALL(GetNumberOfVariableDependencies, q1, &count)
CALL(GetVariableDependencies, q1, NULL, NULL, NULL, NULL, 0)
CALL(ActivateModelPartition, 0, 0.0)

/* ---- With more than arguments --------------------------------------------------------------- */

static fmi3Status ok_if(bool condition) {
    return condition ? fmi3OK : fmi3Error;
}

static fmi3Status call_GetVersion(fmi3Instance c, double now) {
    return ok_if(strcmp(fmu3.GetVersion(), "3.0") == 0);
}

static fmi3Status freed(fmi3Instance made) {
    fmu3.FreeInstance(made);
    return ok_if(made != NULL);
}

static fmi3Status call_InstantiateModelExchange(fmi3Instance c, double now) {
    return freed(fmu3.InstantiateModelExchange("other", RP_MANIPULATOR_TOKEN_FMI3, "", false, false,
                                               NULL, NULL));
}

static fmi3Status call_InstantiateCoSimulation(fmi3Instance c, double now) {
    return freed(fmu3.InstantiateCoSimulation("other", RP_MANIPULATOR_TOKEN_FMI3, "", false, false,
                                              true, false, NULL, 0, NULL, NULL, NULL));
}

/* There is none. */
static fmi3Status call_InstantiateScheduledExecution(fmi3Instance c, double now) {
    return ok_if(fmu3.InstantiateScheduledExecution("other", RP_MANIPULATOR_TOKEN_FMI3, "", false,
                                                    false, NULL, NULL, NULL, NULL, NULL) == NULL);
}

static fmi3Status call_FreeInstance(fmi3Instance c, double now) {
    fmu3_free(c);
    return fmi3OK;
}

static fmi3Status call_DoStep(fmi3Instance c, double now) {
    return fmu3_try_step(c, now, calls_step).status;
}

/* With a state that the instance has given out, or with none where it gives out none. */
static fmi3Status call_with_state(enum fmu3_function function, fmi3Instance c) {
    static fmi3Byte bytes[65536];
    fmi3FMUState state = NULL;
    fmi3FMUState copy = NULL;
    size_t size = 0;
    fmi3Status status = fmu3.GetFMUState(c, &state);
    if (function == FMU3_SetFMUState) {
        status = fmu3.SetFMUState(c, state);
    } else if (function != FMU3_GetFMUState) {
        const fmi3Status sized = fmu3.SerializedFMUStateSize(c, state, &size);
        status = function == FMU3_SerializedFMUStateSize
                     ? sized
                     : fmu3.SerializeFMUState(c, state, bytes, size);
    }
    if (function == FMU3_DeserializeFMUState) {
        status = fmu3.DeserializeFMUState(c, bytes, size, &copy);
    }
    if (state != NULL) {
        fmu3.FreeFMUState(c, &state);
    }
    if (copy != NULL) {
        fmu3.FreeFMUState(c, &copy);
    }
    return status;
}

#define CALL_WITH_STATE(name)                                                                      \
    static fmi3Status call_##name(fmi3Instance c, double now) {                                    \
        return call_with_state(FMU3_##name, c);                                                    \
    }
CALL_WITH_STATE(GetFMUState)
CALL_WITH_STATE(SetFMUState)
CALL_WITH_STATE(SerializedFMUStateSize)
CALL_WITH_STATE(SerializeFMUState)
CALL_WITH_STATE(DeserializeFMUState)

/* Calls function with arguments that are sound in every state the function is allowed in, and
 * returns its status; functions that return something else give fmi3OK where it is right. now (s)
 * is the communication point for DoStep. FreeInstance frees the instance. */
static fmi3Status fmu3_call(enum fmu3_function function, fmi3Instance c, double now) {
#define CALL_OF(name, kinds, states) call_##name,
    static fmi3Status (*const calls[])(fmi3Instance c, double now) = {FMI3_FUNCTION_LIST(CALL_OF)};
#undef CALL_OF
    return calls[function](c, now);
}

/* ---- What is allowed ------------------------------------------------------------------------- */

/* The tables of the standard. I instantiated, M initialization mode, V event mode, N
 * continuous-time mode, S step mode, U intermediate update mode, T terminated, which is also where
 * an error leads. Of Co-Simulation with event mode; without it there is no V, and the two calls
 * that lead to it and back are errors. Functions that this FMU does not support are errors
 * everywhere. */
static const struct {
    const char *model_exchange, *co_simulation;
} allowed[FMU3_FUNCTION_COUNT] = {
    [FMU3_GetVersion] = {"IMVNT", "IMVSUT"},
    [FMU3_SetDebugLogging] = {"IMVNT", "IMVST"},
    [FMU3_InstantiateModelExchange] = {"IMVNT", "IMVSUT"},
    [FMU3_InstantiateCoSimulation] = {"IMVNT", "IMVSUT"},
    [FMU3_InstantiateScheduledExecution] = {"IMVNT", "IMVSUT"},
    [FMU3_FreeInstance] = {"IMVNT", "IMVST"},
    [FMU3_EnterInitializationMode] = {"I", "I"},
    [FMU3_ExitInitializationMode] = {"M", "M"},
    [FMU3_EnterEventMode] = {"N", "S"},
    [FMU3_Terminate] = {"VN", "VS"},
    [FMU3_Reset] = {"IMVNT", "IMVST"},
#define OF_TYPE(type) [FMU3_Get##type] = {"IMVNT", "IMVSUT"}, [FMU3_Set##type] = {"IMVN", "IMVSU"}
    OF_TYPE(Float32),
    OF_TYPE(Float64),
    OF_TYPE(Int8),
    OF_TYPE(UInt8),
    OF_TYPE(Int16),
    OF_TYPE(UInt16),
    OF_TYPE(Int32),
    OF_TYPE(UInt32),
    OF_TYPE(Int64),
    OF_TYPE(UInt64),
    OF_TYPE(Boolean),
    OF_TYPE(String),
    OF_TYPE(Binary),
#undef OF_TYPE
    [FMU3_GetClock] = {"", ""},
    [FMU3_SetClock] = {"", ""},
    [FMU3_GetNumberOfVariableDependencies] = {"", ""},
    [FMU3_GetVariableDependencies] = {"", ""},
    [FMU3_GetFMUState] = {"IMVNT", "IMVST"},
    [FMU3_SetFMUState] = {"IMVNT", "IMVST"},
    [FMU3_FreeFMUState] = {"IMVNT", "IMVST"},
    [FMU3_SerializedFMUStateSize] = {"IMVNT", "IMVST"},
    [FMU3_SerializeFMUState] = {"IMVNT", "IMVST"},
    [FMU3_DeserializeFMUState] = {"IMVNT", "IMVST"},
    [FMU3_GetDirectionalDerivative] = {"MVNT", "MVST"},
    [FMU3_GetAdjointDerivative] = {"MVNT", "MVST"},
    [FMU3_EnterConfigurationMode] = {"", ""}, // needs structural parameters
    [FMU3_ExitConfigurationMode] = {"", ""},
    [FMU3_GetIntervalDecimal] = {"", ""},
    [FMU3_GetIntervalFraction] = {"", ""},
    [FMU3_GetShiftDecimal] = {"", ""},
    [FMU3_GetShiftFraction] = {"", ""},
    [FMU3_SetIntervalDecimal] = {"", ""},
    [FMU3_SetIntervalFraction] = {"", ""},
    [FMU3_SetShiftDecimal] = {"", ""},
    [FMU3_SetShiftFraction] = {"", ""},
    [FMU3_EvaluateDiscreteStates] = {"", ""},
    [FMU3_UpdateDiscreteStates] = {"V", "V"},
    // only Model Exchange
    [FMU3_EnterContinuousTimeMode] = {"V", ""},
    [FMU3_CompletedIntegratorStep] = {"N", ""},
    [FMU3_SetTime] = {"VN", ""}, // V: as FMI 2.0
    [FMU3_SetContinuousStates] = {"N", ""},
    [FMU3_GetContinuousStateDerivatives] = {"MVNT", ""},
    [FMU3_GetEventIndicators] = {"MVNT", ""},
    [FMU3_GetContinuousStates] = {"MVNT", ""},
    // constants: in more states than the standard asks for, as fmusim reads them while it
    // integrates
    [FMU3_GetNominalsOfContinuousStates] = {"IMVNT", ""},
    [FMU3_GetNumberOfEventIndicators] = {"IMVNT", ""},
    [FMU3_GetNumberOfContinuousStates] = {"IMVNT", ""},
    // only Co-Simulation
    [FMU3_EnterStepMode] = {"", "V"},
    [FMU3_GetOutputDerivatives] = {"", "VSUT"},
    [FMU3_DoStep] = {"", "S"},
    [FMU3_ActivateModelPartition] = {"", ""}, // only Scheduled Execution
};

enum kind { MODEL_EXCHANGE, CO_SIMULATION, CO_SIMULATION_WITH_EVENTS };

static bool is_allowed(enum kind kind, enum fmu3_function function, char state) {
    if (kind == CO_SIMULATION &&
        (function == FMU3_EnterEventMode || function == FMU3_EnterStepMode)) {
        return false;
    }
    const char *states =
        kind == MODEL_EXCHANGE ? allowed[function].model_exchange : allowed[function].co_simulation;
    TEST_ASSERT_NOT_NULL_MESSAGE(states, fmu3_function_names[function]);
    return strchr(states, state) != NULL;
}

static char state_after(enum kind kind, enum fmu3_function function, char state) {
    switch (function) {
    case FMU3_EnterInitializationMode:
        return 'M';
    case FMU3_ExitInitializationMode:
        return kind == CO_SIMULATION ? 'S' : 'V';
    case FMU3_EnterEventMode:
        return 'V';
    case FMU3_EnterContinuousTimeMode:
        return 'N';
    case FMU3_EnterStepMode:
        return 'S';
    case FMU3_Terminate:
        return 'T';
    case FMU3_Reset:
        return 'I';
    default:
        return state;
    }
}

/* ---- States --------------------------------------------------------------------------------- */

static const fmi3ValueReference in_updates[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_q1};

static fmi3Instance instantiate(enum kind kind) {
    const struct fmu3_options options = {
        .event_mode = kind == CO_SIMULATION_WITH_EVENTS,
        .intermediate_updates = true,
        .required = in_updates,
        .required_count = FMU_COUNT(in_updates),
    };
    return kind == MODEL_EXCHANGE ? fmu3_model_exchange() : fmu3_co_simulation(&options);
}

static fmi3Instance reach(enum kind kind, char state) {
    const fmi3Instance c = instantiate(kind);
    if (state != 'I') {
        ASSERT_OK(fmu3.EnterInitializationMode(c, false, 0.0, 0.0, false, 0.0));
    }
    if (strchr("VNST", state) != NULL) {
        ASSERT_OK(fmu3.ExitInitializationMode(c));
    }
    if (state == 'N') {
        ASSERT_OK(fmu3.EnterContinuousTimeMode(c));
    } else if (state == 'S' && kind == CO_SIMULATION_WITH_EVENTS) {
        ASSERT_OK(fmu3.EnterStepMode(c));
    } else if (state == 'T') {
        ASSERT_OK(fmu3.Terminate(c));
    }
    fmu_log_clear(&messages);
    return c;
}

/* A call that works in no other state of the kind; T: what a refusal says. */
static void assert_in_state(enum kind kind, char state, fmi3Instance c, double now,
                            const char *text) {
    static const struct {
        char state;
        enum fmu3_function proof;
    } proofs[] = {
        {'I', FMU3_EnterInitializationMode},
        {'M', FMU3_ExitInitializationMode},
        {'V', FMU3_UpdateDiscreteStates},
        {'N', FMU3_CompletedIntegratorStep},
        {'S', FMU3_DoStep},
    };
    for (size_t i = 0; i < FMU_COUNT(proofs); i++) {
        if (proofs[i].state == state) {
            TEST_ASSERT_EQUAL_INT_MESSAGE(fmi3OK, fmu3_call(proofs[i].proof, c, now), text);
            return;
        }
    }
    fmu_log_clear(&messages);
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi3Error, fmu3_try_set(c, RP_MANIPULATOR_tau1, 1.0), text);
    fmu_assert_logged(&messages, "terminated");
    (void)fmu3_get(c, RP_MANIPULATOR_q1);
}

/* ---- One function in one state -------------------------------------------------------------- */

static void check(enum kind kind, enum fmu3_function function, char state) {
    char text[128];
    snprintf(text, sizeof text, "%s, kind %d, state %c", fmu3_function_names[function], (int)kind,
             state);
    const fmi3Instance c = reach(kind, state);
    if (function == FMU3_FreeInstance) {
        fmu3_free(c);
        TEST_ASSERT_EQUAL_UINT_MESSAGE(0, fmu_log_total(&messages), text);
        return;
    }
    const fmi3Status status = fmu3_call(function, c, 0.0);
    if (is_allowed(kind, function, state)) {
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi3OK, status, text);
        TEST_ASSERT_EQUAL_UINT_MESSAGE(0, messages.count[fmi3Error], text);
        assert_in_state(kind, state_after(kind, function, state), c,
                        function == FMU3_DoStep ? calls_step : 0.0, text);
    } else {
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi3Error, status, text);
        TEST_ASSERT_EQUAL_UINT_MESSAGE(1, messages.count[fmi3Error], text);
        fmu_assert_logged(&messages, fmu3_function_names[function]);
        assert_in_state(kind, 'T', c, 0.0, text);
    }
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi3OK, fmu3.Reset(c), text);
    assert_in_state(kind, 'I', c, 0.0, text);
    fmu3_free(c);
}

static void check_all(enum kind kind, const char *states) {
    for (; *states != '\0'; states++) {
        for (int function = 0; function < FMU3_FUNCTION_COUNT; function++) {
            check(kind, (enum fmu3_function)function, *states);
        }
    }
}

static void test_model_exchange(void) {
    check_all(MODEL_EXCHANGE, "IMVNT");
}

static void test_co_simulation(void) {
    check_all(CO_SIMULATION, "IMST");
}

static void test_co_simulation_with_event_mode(void) {
    check_all(CO_SIMULATION_WITH_EVENTS, "IMVST");
}

/* ---- Intermediate update mode ---------------------------------------------------------------- */

/* A call in the first update that allows it. */
struct inside {
    enum fmu3_function function;
    bool is_called;
    fmi3Status status;
};

static bool sets(enum fmu3_function function) {
    return function >= FMU3_SetFloat32 && function <= FMU3_SetBinary;
}

static void call_inside(struct fmu3_importer *of, const struct fmu3_update *update) {
    struct inside *inside = of->data;
    if (!inside->is_called && update->set == sets(inside->function)) {
        inside->is_called = true;
        if (inside->function == FMU3_FreeInstance) { // the harness is not to forget it
            fmu3.FreeInstance(of->instance);
        } else {
            inside->status = fmu3_call(inside->function, of->instance, update->time);
        }
    }
}

static void test_intermediate_update_mode(void) {
    for (int function = 0; function < FMU3_FUNCTION_COUNT; function++) {
        const char *name = fmu3_function_names[function];
        struct inside inside = {(enum fmu3_function)function, false, fmi3OK};
        const fmi3Instance c = reach(CO_SIMULATION, 'S');
        importer.update = call_inside;
        importer.data = &inside;
        const fmi3Status status = fmu3_try_step(c, 0.0, 0.5).status;
        TEST_ASSERT_TRUE_MESSAGE(inside.is_called, name);
        if (is_allowed(CO_SIMULATION, inside.function, 'U')) {
            TEST_ASSERT_EQUAL_INT_MESSAGE(fmi3OK, inside.status, name);
            TEST_ASSERT_EQUAL_INT_MESSAGE(fmi3OK, status, name);
            assert_in_state(CO_SIMULATION, 'S', c, 0.5, name);
        } else {
            TEST_ASSERT_TRUE_MESSAGE(inside.status == fmi3Error || function == FMU3_FreeInstance,
                                     name);
            TEST_ASSERT_EQUAL_INT_MESSAGE(fmi3Error, status, name);
            fmu_assert_logged(&messages, name);
            assert_in_state(CO_SIMULATION, 'T', c, 0.0, name);
        }
        importer.update = NULL;
        fmu3_free(c);
    }
}

/* ---- No instance ---------------------------------------------------------------------------- */

static bool needs_no_instance(int function) {
    return function == FMU3_GetVersion || (function >= FMU3_InstantiateModelExchange &&
                                           function <= FMU3_InstantiateScheduledExecution);
}

static void test_no_instance_is_an_error_and_no_crash(void) {
    for (int function = 0; function < FMU3_FUNCTION_COUNT; function++) {
        const bool is_fine = function == FMU3_FreeInstance || needs_no_instance(function);
        TEST_ASSERT_EQUAL_INT_MESSAGE(is_fine ? fmi3OK : fmi3Error,
                                      fmu3_call((enum fmu3_function)function, NULL, 0.0),
                                      fmu3_function_names[function]);
    }
}
