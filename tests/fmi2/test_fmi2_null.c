/* A pointer that is NULL where a function needs one: one error that names the function, nothing is
 * written, and a state saved before leads back. Arrays of any length: test_fmi2_values.c,
 * test_fmi2_model_exchange.c. */
#include "fmu_harness.h"

#include <unity.h>

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

static void test_derivatives(void) {
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

static void test_states(void) {
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

static void test_model_exchange(void) {
    fmi2Boolean flag;
    c = fmu_me_initialized(&messages, 0.0);
    REFUSED(CompletedIntegratorStep, fmi2True, NULL, &flag);
    REFUSED(CompletedIntegratorStep, fmi2True, &flag, NULL);
    ASSERT_OK(fmu.EnterEventMode(c));
    REFUSED(NewDiscreteStates, NULL);
}

static void test_categories(void) {
    c = fmu_instantiate(&messages, false);
    REFUSED(SetDebugLogging, fmi2True, 3, NULL);
}

static void test_only_in_fmi_2(void) {
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
