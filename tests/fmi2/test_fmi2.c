/* Instances of the FMU: what Instantiate refuses, free and reset, and pointers that are NULL. Many
 * instances at once: robustness/threads.c. FMI 2.0, sections 2.1.5 and 2.1.6. */
#include "fmu_harness.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

/* ---- Instantiate ---------------------------------------------------------------------------- */

static void test_instantiate_says_what_it_refuses(void) {
    fmu_only_in(2, "FMI 3.0 has other arguments: test_fmi3.c");
    static const char guid[] = RP_MANIPULATOR_GUID;
    static const struct {
        const char *name;
        fmi2Type type;
        const char *guid;
        const char *wrong, *expected; /* words of the message */
    } cases[] = {
        {NULL, fmi2CoSimulation, guid, "name", "not empty"},
        {"", fmi2CoSimulation, guid, "name", "not empty"},
        {"m", (fmi2Type)7, guid, "type", "7"},
        {"m", (fmi2Type)-1, guid, "type", "-1"},
        {"m", fmi2CoSimulation, NULL, "GUID", guid},
        {"m", fmi2CoSimulation, "", "GUID", guid},
        {"m", fmi2CoSimulation, "{another}", "{another}", guid},
        {"m", fmi2CoSimulation, "{%s%n#}", "GUID", guid},
        {"m", fmi2ModelExchange, "{another}", "{another}", guid},
    };
    for (size_t i = 0; i < FMU_COUNT(cases); i++) {
        fmu_log_clear(&messages);
        const fmi2CallbackFunctions callbacks = fmu_callbacks(&messages);
        TEST_ASSERT_NULL(fmu.Instantiate(cases[i].name, cases[i].type, cases[i].guid, NULL,
                                         &callbacks, fmi2False, fmi2False));
        TEST_ASSERT_EQUAL_UINT(1, fmu_log_total(&messages));
        TEST_ASSERT_EQUAL_UINT(1, fmu_log_count(&messages, "logStatusError"));
        fmu_assert_logged(&messages, cases[i].wrong);
        fmu_assert_logged(&messages, cases[i].expected);
    }
}

static void test_instantiate_without_functions_gives_no_instance(void) {
    fmu_only_in(2, "FMI 3.0 has no structure of callbacks");
    TEST_ASSERT_NULL(fmu.Instantiate("m", fmi2CoSimulation, RP_MANIPULATOR_GUID, NULL, NULL,
                                     fmi2False, fmi2True));
    TEST_ASSERT_NULL(fmu.Instantiate(NULL, fmi2ModelExchange, NULL, NULL, NULL, 0, 0));
}

/* Nor with any of the other functions: canNotUseMemoryManagementFunctions is declared. */
static void test_instantiate_without_logger_gives_no_crash(void) {
    const fmi2CallbackFunctions none = {0};
    TEST_ASSERT_NULL(fmu.Instantiate("", fmi2CoSimulation, RP_MANIPULATOR_GUID, "", &none, 0, 0));
    TEST_ASSERT_NULL(fmu.Instantiate("m", fmi2CoSimulation, "wrong", "", &none, 0, 0));

    const fmi2Component c = fmu.Instantiate("m", fmi2CoSimulation, RP_MANIPULATOR_GUID,
                                            "file:///nowhere", &none, 0, fmi2True);
    TEST_ASSERT_NOT_NULL(c);
    ASSERT_OK(fmu.SetDebugLogging(c, fmi2True, 0, NULL));
    ASSERT_DISCARD(fmu_try_set(c, RP_MANIPULATOR_tau1, NAN));
    ASSERT_ERROR(fmu_try_set(c, RP_MANIPULATOR_ddq1, 1.0));
    fmu_assert_reset_is_fresh(c, "without callbacks");
    fmu.FreeInstance(c);
}

static char *copied(const char *text) {
    const size_t size = strlen(text) + 1;
    char *copy = malloc(size);
    TEST_ASSERT_NOT_NULL(copy);
    return memcpy(copy, text, size);
}

static void test_nothing_passed_to_instantiate_is_kept(void) {
    char *name = copied("short-lived");
    char *guid = copied(RP_MANIPULATOR_GUID);
    fmi2CallbackFunctions *callbacks = malloc(sizeof *callbacks);
    TEST_ASSERT_NOT_NULL(callbacks);
    *callbacks = fmu_callbacks(&messages);
    const fmi2Component c =
        fmu.Instantiate(name, fmi2CoSimulation, guid, name, callbacks, fmi2False, fmi2False);
    memset(name, 'x', strlen(name));
    memset(guid, 'x', strlen(guid));
    memset(callbacks, 0x55, sizeof *callbacks);
    free(name);
    free(guid);
    free(callbacks);

    TEST_ASSERT_NOT_NULL(c);
    ASSERT_ERROR(fmu_try_set(c, RP_MANIPULATOR_ddq1, 1.0));
    TEST_ASSERT_EQUAL_STRING("short-lived", messages.instance_name);
    fmu_assert_reset_is_fresh(c, "after the arguments of Instantiate are gone");
    fmu.FreeInstance(c);
}

/* ---- Free and Reset ------------------------------------------------------------------------- */

static void test_free_of_nothing_does_nothing(void) {
    fmu.FreeInstance(NULL);

    const fmi2Component c = fmu_initialized(&messages, 0.0);
    fmi2FMUstate none = NULL;
    ASSERT_OK(fmu.FreeFMUstate(c, NULL));
    ASSERT_OK(fmu.FreeFMUstate(c, &none));
    TEST_ASSERT_NULL(none);
    ASSERT_OK(fmu.DoStep(c, 0.0, 0.1, fmi2True));
    TEST_ASSERT_EQUAL_UINT(0, fmu_log_total(&messages));
}

static void test_reset_leaves_no_experiment(void) {
    fmu_only_in(2, "in FMI 3.0 the experiment comes with this call");
    const fmi2Component c = fmu_initialized(&messages, 0.0);
    ASSERT_OK(fmu.Reset(c));
    ASSERT_ERROR(fmu.EnterInitializationMode(c));
    fmu_assert_logged(&messages, "experiment");
    fmu_assert_in_error(c);
    fmu_assert_reset_is_fresh(c, "after an initialization without experiment");
}

/* ---- Pointers that are NULL ------------------------------------------------------------------ */

/* Where a function needs one: one error that names the function, nothing is written, and a state
 * saved before leads back. Arrays of any length: test_fmi2_values.c, test_fmi2_model_exchange.c. */
static fmi2Component c;
static fmi2FMUstate saved;
static double value;

static void begin(void) {
    saved = fmu_save(c);
    value = -1.0;
    fmu_log_clear(&messages);
}

static void assert_refused(enum fmu_function function, fmi2Status status) {
    const char *name = fmu_name_of(function);
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2Error, status, name);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, messages.count[fmi2Error], name);
    fmu_assert_logged(&messages, name);
    TEST_ASSERT_TRUE_MESSAGE(value == -1.0, name);
    fmu_assert_in_error(c);
    fmu_restore(c, saved);
    fmu_forget(c, &saved);
}

#define REFUSED(function, ...)                                                                     \
    begin();                                                                                       \
    assert_refused(FMU_##function, fmu.function(c, __VA_ARGS__))

static const fmi2ValueReference q1 = RP_MANIPULATOR_q1, ddq1 = RP_MANIPULATOR_ddq1;
static const fmi2ValueReference tau1 = RP_MANIPULATOR_tau1;
static const fmi2Integer order = 1;
static const double one = 1.0;

static void test_null_in_calls_of_derivatives(void) {
    c = fmu_initialized(&messages, 0.0);
    REFUSED(GetDirectionalDerivative, NULL, 1, &tau1, 1, &one, &value);
    REFUSED(GetDirectionalDerivative, &ddq1, 1, NULL, 1, &one, &value);
    REFUSED(GetDirectionalDerivative, &ddq1, 1, &tau1, 1, NULL, &value);
    REFUSED(GetDirectionalDerivative, &ddq1, 1, &tau1, 1, &one, NULL);
    ASSERT_OK(fmu.GetRealOutputDerivatives(c, NULL, 0, NULL, NULL));
    REFUSED(GetRealOutputDerivatives, NULL, 1, &order, &value);
    REFUSED(GetRealOutputDerivatives, &q1, 1, NULL, &value);
    REFUSED(GetRealOutputDerivatives, &q1, 1, &order, NULL);
    ASSERT_OK(fmu.DoStep(c, 0.0, 0.1, fmi2True));
}

static void test_null_in_calls_of_states(void) {
    static fmi2Byte bytes[16384];
    size_t size = sizeof bytes;
    fmi2FMUstate made = NULL;
    c = fmu_initialized(&messages, 0.0);
    REFUSED(GetFMUstate, NULL);
    REFUSED(SetFMUstate, NULL);
    REFUSED(SerializedFMUstateSize, NULL, &size);
    REFUSED(SerializedFMUstateSize, saved, NULL);
    REFUSED(SerializeFMUstate, NULL, bytes, size);
    REFUSED(SerializeFMUstate, saved, NULL, size);
    REFUSED(DeSerializeFMUstate, NULL, size, &made);
    REFUSED(DeSerializeFMUstate, NULL, 0, &made);
    made = fmu_save(c);
    ASSERT_OK(fmu.SerializedFMUstateSize(c, made, &size));
    ASSERT_OK(fmu.SerializeFMUstate(c, made, bytes, size));
    REFUSED(DeSerializeFMUstate, bytes, size, NULL);
    ASSERT_OK(fmu.DoStep(c, 0.0, 0.1, fmi2True));
}

static void test_null_in_calls_of_model_exchange(void) {
    fmi2Boolean flag;
    c = fmu_me_initialized(&messages, 0.0);
    REFUSED(CompletedIntegratorStep, fmi2True, NULL, &flag);
    REFUSED(CompletedIntegratorStep, fmi2True, &flag, NULL);
    ASSERT_OK(fmu.EnterEventMode(c));
    REFUSED(NewDiscreteStates, NULL);
}

static void test_null_in_calls_of_categories(void) {
    c = fmu_instantiate(&messages, false);
    REFUSED(SetDebugLogging, fmi2True, 3, NULL);
}

static void test_null_in_calls_of_fmi_2(void) {
    fmu_only_in(2, "FMI 3.0 has neither a status of a step nor derivatives of inputs");
    c = fmu_initialized(&messages, 0.0);
    REFUSED(GetStatus, fmi2DoStepStatus, NULL);
    REFUSED(GetRealStatus, fmi2LastSuccessfulTime, NULL);
    REFUSED(GetIntegerStatus, fmi2DoStepStatus, NULL);
    REFUSED(GetBooleanStatus, fmi2Terminated, NULL);
    REFUSED(GetStringStatus, fmi2PendingStatus, NULL);
    ASSERT_OK(fmu.SetRealInputDerivatives(c, NULL, 0, NULL, NULL));
    REFUSED(SetRealInputDerivatives, NULL, 1, &order, &value);
    REFUSED(SetRealInputDerivatives, &tau1, 1, NULL, &value);
    REFUSED(SetRealInputDerivatives, &tau1, 1, &order, NULL);
}
