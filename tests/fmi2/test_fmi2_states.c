/* Which function works in which state: sections 4.2.4 (Co-Simulation) and 3.2.3 (Model Exchange) of
 * FMI 2.0. */
#include "fmi_states.h"
#include "fmu_harness.h"

#include <stdio.h>
#include <string.h>
#include <unity.h>

/* The tables of the standard; the letters are those of fmi_states.h. No step is ever pending, so
 * that CancelStep never fits. */
static const struct {
    const char *co_simulation, *model_exchange;
} allowed[FMU_FUNCTION_COUNT] = {
    [FMU_GetTypesPlatform] = {"IMCFTE", "IMVNTE"},
    [FMU_GetVersion] = {"IMCFTE", "IMVNTE"},
    [FMU_SetDebugLogging] = {"IMCFTE", "IMVNTE"},
    [FMU_Instantiate] = {"IMCFTE", "IMVNTE"},
    [FMU_FreeInstance] = {"IMCFTE", "IMVNTE"},
    [FMU_SetupExperiment] = {"I-----", "I-----"},
    [FMU_EnterInitializationMode] = {"I-----", "I-----"},
    [FMU_ExitInitializationMode] = {"-M----", "-M----"},
    [FMU_Terminate] = {"--CF--", "--VN--"},
    [FMU_Reset] = {"IMCFTE", "IMVNTE"},
    [FMU_GetReal] = {"-MCFTE", "-MVNTE"},
    [FMU_GetInteger] = {"-MCFTE", "-MVNTE"},
    [FMU_GetBoolean] = {"-MCFTE", "-MVNTE"},
    [FMU_GetString] = {"-MCFTE", "-MVNTE"},
    [FMU_SetReal] = {"IMC---", "IMVN--"}, // which variables: test_fmi2_values.c
    [FMU_SetInteger] = {"IMC---", "IMV---"},
    [FMU_SetBoolean] = {"IMC---", "IMV---"},
    [FMU_SetString] = {"IMC---", "IMV---"},
    [FMU_GetFMUstate] = {"IMCFTE", "IMVNTE"},
    [FMU_SetFMUstate] = {"IMCFTE", "IMVNTE"},
    [FMU_FreeFMUstate] = {"IMCFTE", "IMVNTE"},
    [FMU_SerializedFMUstateSize] = {"IMCFTE", "IMVNTE"},
    [FMU_SerializeFMUstate] = {"IMCFTE", "IMVNTE"},
    [FMU_DeSerializeFMUstate] = {"IMCFTE", "IMVNTE"},
    [FMU_GetDirectionalDerivative] = {"-MCFTE", "-MVNTE"},
    // only Co-Simulation
    [FMU_SetRealInputDerivatives] = {"IMC---", "------"},
    [FMU_GetRealOutputDerivatives] = {"--CFTE", "------"},
    [FMU_DoStep] = {"--C---", "------"},
    [FMU_CancelStep] = {"------", "------"},
    [FMU_GetStatus] = {"--CFT-", "------"},
    [FMU_GetRealStatus] = {"--CFT-", "------"},
    [FMU_GetIntegerStatus] = {"--CFT-", "------"},
    [FMU_GetBooleanStatus] = {"--CFT-", "------"},
    [FMU_GetStringStatus] = {"--CFT-", "------"},
    // only Model Exchange
    [FMU_EnterEventMode] = {"------", "--VN--"},
    [FMU_NewDiscreteStates] = {"------", "--V---"},
    [FMU_EnterContinuousTimeMode] = {"------", "--V---"},
    [FMU_CompletedIntegratorStep] = {"------", "---N--"},
    [FMU_SetTime] = {"------", "--VN--"},
    [FMU_SetContinuousStates] = {"------", "---N--"},
    [FMU_GetDerivatives] = {"------", "-MVNTE"}, // M: as FMI 3.0
    [FMU_GetEventIndicators] = {"------", "-MVNTE"},
    [FMU_GetContinuousStates] = {"------", "-MVNTE"},
    [FMU_GetNominalsOfContinuousStates] = {"------", "IMVNTE"}, // M: as FMI 3.0
};

static const char *allowed_states(fmi2Type type, enum fmu_function function) {
    return type == fmi2CoSimulation ? allowed[function].co_simulation
                                    : allowed[function].model_exchange;
}

static fmi2Status expected_where_allowed(enum fmu_function function) {
    switch (function) {
    case FMU_GetStatus: // no step is pending
    case FMU_GetIntegerStatus:
    case FMU_GetStringStatus:
        return fmi2Discard;
    default:
        return fmi2OK;
    }
}

static char letter_after(fmi2Type type, enum fmu_function function, char letter) {
    switch (function) {
    case FMU_EnterInitializationMode:
        return 'M';
    case FMU_ExitInitializationMode:
        return type == fmi2CoSimulation ? 'C' : 'V';
    case FMU_EnterEventMode:
        return 'V';
    case FMU_EnterContinuousTimeMode:
        return 'N';
    case FMU_Terminate:
        return 'T';
    case FMU_Reset:
        return 'I';
    default:
        return letter;
    }
}

/* ---- One function in one state -------------------------------------------------------------- */

struct pair {
    fmi2Type type;
    enum fmu_function function;
    const struct fmi_state *state;
    char text[128];
};

static const double step = 0.01;

static fmi2Status call(const struct pair *pair, fmi2Component c) {
    fmu_log_clear(&messages);
    return fmu_call(pair->function, c, 0.0, step);
}

static void assert_works(const struct pair *pair, fmi2Component c) {
    const fmi2Status expected = expected_where_allowed(pair->function);
    TEST_ASSERT_EQUAL_INT_MESSAGE(expected, call(pair, c), pair->text);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, messages.count[fmi2Error], pair->text);
    const char after = letter_after(pair->type, pair->function, pair->state->letter);
    fmu_assert_in_state(c, fmi_state_of(pair->type, after),
                        pair->function == FMU_DoStep ? step : 0.0, &messages, pair->text);
}

static void assert_refused(const struct pair *pair, fmi2Component c) {
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2Error, call(pair, c), pair->text);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, messages.count[fmi2Error], pair->text);
    fmu_assert_logged(&messages, fmu_name_of(pair->function));
    fmu_assert_in_state(c, fmi_state_of(pair->type, 'E'), 0.0, &messages, pair->text);
}

static void check(const struct pair *pair) {
    const char *states = allowed_states(pair->type, pair->function);
    TEST_ASSERT_NOT_NULL_MESSAGE(states, pair->text);
    const fmi2Component c = fmu_reach(pair->type, pair->state, &messages);
    if (pair->function == FMU_FreeInstance) {
        (void)call(pair, c);
        TEST_ASSERT_EQUAL_UINT_MESSAGE(0, fmu_log_total(&messages), pair->text);
        return;
    }
    if (strchr(states, pair->state->letter) != NULL) {
        assert_works(pair, c);
    } else {
        assert_refused(pair, c);
    }
    fmu_assert_reset_is_fresh_as(pair->type, c, pair->text);
    fmu_free(c);
}

static void check_all(fmi2Type type) {
    const struct fmi_states *states = fmi_states_of(type);
    for (size_t i = 0; i < states->count * FMU_FUNCTION_COUNT; i++) {
        struct pair pair = {
            .type = type,
            .function = (enum fmu_function)(i % FMU_FUNCTION_COUNT),
            .state = &states->states[i / FMU_FUNCTION_COUNT],
        };
        snprintf(pair.text, sizeof pair.text, "%s of a %s instance %s", fmu_name_of(pair.function),
                 type == fmi2CoSimulation ? "Co-Simulation" : "Model Exchange", pair.state->name);
        check(&pair);
    }
}

/* ---- Tests ---------------------------------------------------------------------------------- */

static void test_co_simulation(void) {
    check_all(fmi2CoSimulation);
}

static void test_model_exchange(void) {
    check_all(fmi2ModelExchange);
}

static void test_no_instance_is_an_error_and_no_crash(void) {
    for (int function = 0; function < FMU_FUNCTION_COUNT; function++) {
        if (function == FMU_GetTypesPlatform || function == FMU_GetVersion ||
            function == FMU_Instantiate || function == FMU_FreeInstance) {
            continue;
        }
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2Error,
                                      fmu_call((enum fmu_function)function, NULL, 0.0, step),
                                      fmu_name_of((enum fmu_function)function));
    }
}
