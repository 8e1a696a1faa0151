/* How results answer to what is set between steps, and what happens where they overflow. FMI 2.0,
 * sections 2.1.7, 4.2.1 and 4.2.2. */
#include "fmu_harness.h"

#include <math.h>
#include <unity.h>

static void test_get_after_set_answers_for_the_new_inputs(void) {
    static const double inputs[][2] = {{0.0, 0.0}, {3.0, -4.0}, {-50.0, 70.0}};
    const fmi2Component c = fmu_instantiate(&messages, false);
    fmu_set(c, RP_MANIPULATOR_dq1, 1.5);
    fmu_initialize(c, 0.0, 0.0);
    ASSERT_OK(fmu.DoStep(c, 0.0, 0.1, fmi2True));
    double before[4];
    fmu_get_states(c, before);
    for (size_t i = 0; i < FMU_COUNT(inputs); i++) {
        double after[4];
        fmu_set(c, RP_MANIPULATOR_tau1, inputs[i][0]);
        fmu_set(c, RP_MANIPULATOR_f2, inputs[i][1]);
        fmu_assert_motion(c, inputs[i][0], inputs[i][1],
                          1e-12 * (10.0 + fabs(inputs[i][0]) + fabs(inputs[i][1])));
        fmu_get_states(c, after);
        TEST_ASSERT_EQUAL_MEMORY(before, after, sizeof before);
    }
}

static void test_tunable_parameters_keep_the_states(void) {
    static const fmi2ValueReference references[] = {RP_MANIPULATOR_m1, RP_MANIPULATOR_l1,
                                                    RP_MANIPULATOR_g};
    static const double values[] = {4.0, 0.8, 3.7};
    const fmi2Component c = fmu_instantiate(&messages, false);
    fmu_set(c, RP_MANIPULATOR_dq1, 1.0);
    fmu_initialize(c, 0.0, 0.0);
    for (int step = 0; step < 4; step++) {
        ASSERT_OK(fmu.DoStep(c, step / 8.0, 0.125, fmi2True));
    }
    double before[4];
    double after[4];
    fmu_get_states(c, before);
    const double energy = fmu_get(c, RP_MANIPULATOR_total_energy);
    ASSERT_OK(fmu.SetReal(c, references, 3, values));
    fmu_get_states(c, after);
    TEST_ASSERT_EQUAL_MEMORY(before, after, sizeof before);
    TEST_ASSERT_TRUE(energy != fmu_get(c, RP_MANIPULATOR_total_energy));
    fmu_assert_motion(c, 0.0, 0.0, 1e-11);
}

/* ---- Overflow ------------------------------------------------------------------------------- */

/* Finite states whose accelerations and energies are not. */
static const struct {
    fmi2ValueReference reference;
    double value;
    fmi2ValueReference overflows;
    const char *name;
} extremes[] = {
    {RP_MANIPULATOR_dq1, 1e200, RP_MANIPULATOR_ddq2, "ddq2"},
    {RP_MANIPULATOR_dq1, -1e300, RP_MANIPULATOR_kinetic_energy, "kinetic_energy"},
    {RP_MANIPULATOR_q2, 1e200, RP_MANIPULATOR_D11, "D11"},
    {RP_MANIPULATOR_dq2, 1e160, RP_MANIPULATOR_total_energy, "total_energy"},
};

static void test_get_of_an_overflow_is_discarded(void) {
    const double untouched = -12345.678;
    for (size_t i = 0; i < FMU_COUNT(extremes); i++) {
        const fmi2ValueReference references[] = {RP_MANIPULATOR_m1, extremes[i].overflows};
        const fmi2Component c = fmu_instantiate(&messages, false);
        fmu_set(c, extremes[i].reference, extremes[i].value);
        fmu_initialize(c, 0.0, 0.0);
        fmu_log_clear(&messages);
        double values[] = {untouched, untouched};
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2Discard, fmu.GetReal(c, references, 2, values),
                                      extremes[i].name);
        TEST_ASSERT_EQUAL_DOUBLE(untouched, values[0]);
        TEST_ASSERT_EQUAL_DOUBLE(untouched, values[1]);
        fmu_assert_logged(&messages, extremes[i].name);
        TEST_ASSERT_TRUE(extremes[i].value == fmu_get(c, extremes[i].reference));
        fmu_assert_reset_is_fresh(c, extremes[i].name);
        fmu_free(c);
    }
}

static void test_a_step_into_overflow_is_discarded(void) {
    for (size_t i = 0; i < FMU_COUNT(extremes); i++) {
        const fmi2Component c = fmu_instantiate(&messages, false);
        fmu_set(c, RP_MANIPULATOR_dq1, 1e160); // already too fast for the first slope
        fmu_set(c, extremes[i].reference, extremes[i].value);
        fmu_initialize(c, 1.0, 0.0);
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2Discard, fmu.DoStep(c, 1.0, 0.1, fmi2True),
                                      extremes[i].name);
        TEST_ASSERT_GREATER_THAN_UINT(0, messages.count[fmi2Discard]);
        TEST_ASSERT_EQUAL_UINT(0, messages.count[fmi2Error]);

        double reached = NAN;
        double x[4];
        ASSERT_OK(fmu.GetRealStatus(c, fmi2LastSuccessfulTime, &reached));
        TEST_ASSERT_TRUE(reached >= 1.0 && reached < 1.1);
        fmu_get_states(c, x);
        for (int j = 0; j < 4; j++) {
            TEST_ASSERT_TRUE(isfinite(x[j]));
        }
        fmu_assert_reset_is_fresh(c, extremes[i].name);
        fmu_free(c);
    }
}
