/* Which function works in which state: FMI 3.0, sections 2.3, 3.2 and 4.2. */
#include "fmu3_calls.h"

#include <stdio.h>
#include <string.h>
#include <unity.h>

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
                        function == FMU3_DoStep ? fmu3_calls_step : 0.0, text);
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
