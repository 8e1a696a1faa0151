/* Which function works in which state of a co-simulation slave: section 4.2.4 of FMI 2.0. */
#include "fmu_calls.h"
#include "fmu_harness.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

static struct fmu_log messages;

void setUp(void) {
    fmu_log_clear(&messages);
}
void tearDown(void) {
    fmu_tear_down(&messages);
}

/* The table of section 4.2.4. I: instantiated, M: initialization mode, C: step complete, F: step
 * failed, T: terminated, E: error. No step is ever pending, so that CancelStep never fits. */
static const char *const allowed[FMU_FUNCTION_COUNT] = {
    [FMU_GetTypesPlatform] = "IMCFTE",
    [FMU_GetVersion] = "IMCFTE",
    [FMU_SetDebugLogging] = "IMCFTE",
    [FMU_Instantiate] = "IMCFTE",
    [FMU_FreeInstance] = "IMCFTE",
    [FMU_SetupExperiment] = "I-----",
    [FMU_EnterInitializationMode] = "I-----",
    [FMU_ExitInitializationMode] = "-M----",
    [FMU_Terminate] = "--CF--",
    [FMU_Reset] = "IMCFTE",
    [FMU_GetReal] = "-MCFTE",
    [FMU_GetInteger] = "-MCFTE",
    [FMU_GetBoolean] = "-MCFTE",
    [FMU_GetString] = "-MCFTE",
    [FMU_SetReal] = "IMC---",
    [FMU_SetInteger] = "IMC---",
    [FMU_SetBoolean] = "IMC---",
    [FMU_SetString] = "IMC---",
    [FMU_GetFMUstate] = "IMCFTE",
    [FMU_SetFMUstate] = "IMCFTE",
    [FMU_FreeFMUstate] = "IMCFTE",
    [FMU_SerializedFMUstateSize] = "IMCFTE",
    [FMU_SerializeFMUstate] = "IMCFTE",
    [FMU_DeSerializeFMUstate] = "IMCFTE",
    [FMU_GetDirectionalDerivative] = "-MCFTE",
    [FMU_SetRealInputDerivatives] = "IMC---",
    [FMU_GetRealOutputDerivatives] = "--CFTE",
    [FMU_DoStep] = "--C---",
    [FMU_CancelStep] = "------",
    [FMU_GetStatus] = "--CFT-",
    [FMU_GetRealStatus] = "--CFT-",
    [FMU_GetIntegerStatus] = "--CFT-",
    [FMU_GetBooleanStatus] = "--CFT-",
    [FMU_GetStringStatus] = "--CFT-",
    // Model Exchange, on a co-simulation instance
    [FMU_EnterEventMode] = "------",
    [FMU_NewDiscreteStates] = "------",
    [FMU_EnterContinuousTimeMode] = "------",
    [FMU_CompletedIntegratorStep] = "------",
    [FMU_SetTime] = "------",
    [FMU_SetContinuousStates] = "------",
    [FMU_GetDerivatives] = "------",
    [FMU_GetEventIndicators] = "------",
    [FMU_GetContinuousStates] = "------",
    [FMU_GetNominalsOfContinuousStates] = "------",
};

/* What the model description does not declare yet: fmi2Error where the table would allow it. */
static const enum fmu_function not_supported[] = {
    FMU_GetFMUstate,
    FMU_SetFMUstate,
    FMU_SerializedFMUstateSize,
    FMU_SerializeFMUstate,
    FMU_DeSerializeFMUstate,
    FMU_GetDirectionalDerivative,
    FMU_SetRealInputDerivatives,
    FMU_GetRealOutputDerivatives,
};

static bool is_supported(enum fmu_function function) {
    for (size_t i = 0; i < FMU_COUNT(not_supported); i++) {
        if (not_supported[i] == function) {
            return false;
        }
    }
    return true;
}

static const double step = 0.01;
static double now; /* communication point of the instance under test */

static fmi2Status expected_where_allowed(enum fmu_function function) {
    switch (function) {
    case FMU_GetStatus: // asked for the status of a step that is not pending
    case FMU_GetIntegerStatus:
    case FMU_GetStringStatus:
        return fmi2Discard;
    default:
        return fmi2OK;
    }
}

static fmi2Status call(enum fmu_function function, fmi2Component c) {
    const fmi2Status status = fmu_call(function, c, now, step);
    now += function == FMU_DoStep && status == fmi2OK ? step : 0.0;
    return status;
}

/* ---- States --------------------------------------------------------------------------------- */

struct state {
    char letter;
    const char *name;
    enum fmu_function proof; /* works here, but not in the error state */
};

static const struct state states[] = {
    {'I', "instantiated", FMU_SetupExperiment},
    {'M', "in initialization mode", FMU_ExitInitializationMode},
    {'C', "between steps", FMU_DoStep},
    {'F', "after a failed step", FMU_Terminate},
    {'T', "terminated", FMU_GetRealStatus},
    {'E', "in the error state", FMU_FUNCTION_COUNT},
};

static const struct state *state_of(char letter) {
    size_t i = 0;
    while (states[i].letter != letter) {
        i++;
    }
    return &states[i];
}

static const struct state *state_after(enum fmu_function function, const struct state *state) {
    switch (function) {
    case FMU_EnterInitializationMode:
        return state_of('M');
    case FMU_ExitInitializationMode:
        return state_of('C');
    case FMU_Terminate:
        return state_of('T');
    case FMU_Reset:
        return state_of('I');
    default:
        return state;
    }
}

/* The slave takes the one internal step that it may, and gives up. */
static void fail_step(fmi2Component c, double start, double length) {
    TEST_ASSERT_EQUAL_INT(fmi2Discard, fmu.DoStep(c, start, length, fmi2True));
}

static fmi2Component reach(char letter) {
    const fmi2ValueReference max_steps = RP_MANIPULATOR_max_internal_steps;
    const fmi2Integer one = 1;
    const fmi2Component c = fmu_instantiate(&messages, false);
    now = 0.0;
    if (letter == 'F') {
        TEST_ASSERT_EQUAL_INT(fmi2OK, fmu.SetInteger(c, &max_steps, 1, &one));
    }
    TEST_ASSERT_EQUAL_INT(fmi2OK, fmu.SetupExperiment(c, fmi2False, 0, now, fmi2False, 0));
    if (letter != 'I') {
        TEST_ASSERT_EQUAL_INT(fmi2OK, fmu.EnterInitializationMode(c));
    }
    if (strchr("CFTE", letter) != NULL) {
        TEST_ASSERT_EQUAL_INT(fmi2OK, fmu.ExitInitializationMode(c));
    }
    if (letter == 'F') {
        fail_step(c, now, 10.0);
    } else if (letter == 'T') {
        TEST_ASSERT_EQUAL_INT(fmi2OK, fmu.Terminate(c));
    } else if (letter == 'E') {
        TEST_ASSERT_EQUAL_INT(fmi2Error, fmu.ExitInitializationMode(c));
    }
    fmu_log_clear(&messages);
    return c;
}

static void assert_in_state(fmi2Component c, const struct state *state, const char *text) {
    if (state->letter == 'E') {
        fmu_assert_in_error(c);
    } else {
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, call(state->proof, c), text);
    }
}

static void assert_refused(enum fmu_function function, fmi2Status status, fmi2Component c,
                           const struct state *state, const char *text) {
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2Error, status, text);
    TEST_ASSERT_GREATER_THAN_UINT_MESSAGE(0, messages.count[fmi2Error], text);
    fmu_assert_logged(&messages, fmu_function_names[function]);
    if (state->letter != 'E') {
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2Error, call(state->proof, c), text);
    }
    fmu_assert_in_error(c);
}

static void check(enum fmu_function function, const struct state *state) {
    char text[128];
    snprintf(text, sizeof text, "%s while %s", fmu_function_names[function], state->name);
    TEST_ASSERT_NOT_NULL_MESSAGE(allowed[function], text);
    const bool is_allowed = strchr(allowed[function], state->letter) != NULL;

    const fmi2Component c = reach(state->letter);
    const fmi2Status status = call(function, c);
    if (function == FMU_FreeInstance) {
        TEST_ASSERT_EQUAL_UINT_MESSAGE(0, fmu_log_total(&messages), text);
        return;
    }
    if (is_allowed && is_supported(function)) {
        TEST_ASSERT_EQUAL_INT_MESSAGE(expected_where_allowed(function), status, text);
        TEST_ASSERT_EQUAL_UINT_MESSAGE(0, messages.count[fmi2Error], text);
        assert_in_state(c, state_after(function, state), text);
    } else {
        assert_refused(function, status, c, state, text);
        if (is_allowed) {
            fmu_assert_logged(&messages, "not supported");
        }
    }
    fmu_assert_reset_is_fresh(c, text);
    fmu_free(c);
}

static void check_all(char letter) {
    for (int function = 0; function < FMU_FUNCTION_COUNT; function++) {
        check((enum fmu_function)function, state_of(letter));
    }
}

/* ---- Tests ---------------------------------------------------------------------------------- */

static void test_instantiated(void) {
    check_all('I');
}

static void test_initialization_mode(void) {
    check_all('M');
}

static void test_step_complete(void) {
    check_all('C');
}

static void test_step_failed(void) {
    check_all('F');
}

static void test_terminated(void) {
    check_all('T');
}

static void test_error(void) {
    check_all('E');
}

static void test_no_instance_is_an_error_and_no_crash(void) {
    for (int function = 0; function < FMU_FUNCTION_COUNT; function++) {
        if (function == FMU_GetTypesPlatform || function == FMU_GetVersion ||
            function == FMU_Instantiate || function == FMU_FreeInstance) {
            continue;
        }
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2Error, call((enum fmu_function)function, NULL),
                                      fmu_function_names[function]);
    }
}

/* fmi2Discard of fmi2DoStep: section 4.2.2; fmi2LastSuccessfulTime: 4.2.3. */
static void test_a_failed_step_tells_how_far_it_got(void) {
    const fmi2ValueReference max_steps = RP_MANIPULATOR_max_internal_steps;
    const fmi2ValueReference references[] = {RP_MANIPULATOR_q1, RP_MANIPULATOR_q2,
                                             RP_MANIPULATOR_dq1, RP_MANIPULATOR_dq2};
    const double start = 2.0;
    const double length = 10.0;
    const fmi2Integer one = 1;
    const fmi2Component c = fmu_instantiate(&messages, false);
    TEST_ASSERT_EQUAL_INT(fmi2OK, fmu.SetInteger(c, &max_steps, 1, &one));
    fmu_initialize(c, start, 0.0);
    fail_step(c, start, length);
    TEST_ASSERT_GREATER_THAN_UINT(0, messages.count[fmi2Discard]);

    double reached = NAN;
    TEST_ASSERT_EQUAL_INT(fmi2OK, fmu.GetRealStatus(c, fmi2LastSuccessfulTime, &reached));
    TEST_ASSERT_TRUE(reached >= start && reached < start + length);
    TEST_ASSERT_EQUAL_DOUBLE(reached, fmu_get(c, RP_MANIPULATOR_time));

    double x[4] = {NAN, NAN, NAN, NAN};
    TEST_ASSERT_EQUAL_INT(fmi2OK, fmu.GetReal(c, references, 4, x));
    for (size_t i = 0; i < 4; i++) {
        TEST_ASSERT_TRUE(isfinite(x[i]));
    }
    fmi2Boolean terminated = fmi2True;
    TEST_ASSERT_EQUAL_INT(fmi2OK, fmu.GetBooleanStatus(c, fmi2Terminated, &terminated));
    TEST_ASSERT_EQUAL_INT(fmi2False, terminated);
}

int main(int argc, char **argv) {
    if (!fmu_load(argc, argv)) {
        return 2;
    }
    UNITY_BEGIN();
    RUN_TEST(test_instantiated);
    RUN_TEST(test_initialization_mode);
    RUN_TEST(test_step_complete);
    RUN_TEST(test_step_failed);
    RUN_TEST(test_terminated);
    RUN_TEST(test_error);
    RUN_TEST(test_no_instance_is_an_error_and_no_crash);
    RUN_TEST(test_a_failed_step_tells_how_far_it_got);
    return UNITY_END();
}
