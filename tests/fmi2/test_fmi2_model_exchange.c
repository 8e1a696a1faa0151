/* Model Exchange: an importer integrates the model. FMI 2.0, chapter 3; which call works when is in
 * test_fmi2_states.c. */
#include "fmu_harness.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

static fmi2Component in_event_mode(void) {
    const fmi2Component c = fmu_instantiate_as(fmi2ModelExchange, &messages, false);
    fmu_initialize(c, 0.0, 0.0);
    return c;
}

/* ---- States and derivatives ----------------------------------------------------------------- */

static void test_states_are_the_variables(void) {
    const double x[FMU_STATES] = {0.3, -0.2, 1.5, 0.7};
    double got[FMU_STATES];
    double dx[FMU_STATES];
    const fmi2Component c = fmu_me_initialized(&messages, 0.0);
    fmu_set(c, RP_MANIPULATOR_tau1, 3.0);
    ASSERT_OK(fmu.SetContinuousStates(c, x, FMU_STATES));
    fmu_get_states(c, got);
    TEST_ASSERT_EQUAL_MEMORY(x, got, sizeof x);
    ASSERT_OK(fmu.GetContinuousStates(c, got, FMU_STATES));
    TEST_ASSERT_EQUAL_MEMORY(x, got, sizeof x);

    ASSERT_OK(fmu.GetDerivatives(c, dx, FMU_STATES));
    TEST_ASSERT_EQUAL_DOUBLE(x[2], dx[0]);
    TEST_ASSERT_EQUAL_DOUBLE(x[3], dx[1]);
    TEST_ASSERT_EQUAL_DOUBLE(fmu_get(c, RP_MANIPULATOR_ddq1), dx[2]);
    TEST_ASSERT_EQUAL_DOUBLE(fmu_get(c, RP_MANIPULATOR_ddq2), dx[3]);

    const double before = dx[2];
    fmu_set(c, RP_MANIPULATOR_tau1, 4.0); // counts at once
    ASSERT_OK(fmu.GetDerivatives(c, dx, FMU_STATES));
    TEST_ASSERT_TRUE(before != dx[2]);
}

/* CasADi sets them by their value references (section 3.2.3, note 6), one or all. */
static void test_setting_reals_is_setting_states(void) {
    const fmi2Component c = fmu_me_initialized(&messages, 0.0);
    for (unsigned chosen = 0; chosen < 1u << FMU_STATES; chosen++) {
        fmi2ValueReference references[FMU_STATES];
        double some[FMU_STATES];
        double x[FMU_STATES];
        double expected[FMU_STATES];
        double dx[FMU_STATES];
        size_t count = 0;
        ASSERT_OK(fmu.GetContinuousStates(c, x, FMU_STATES));
        for (size_t i = 0; i < FMU_STATES; i++) {
            if (chosen >> i & 1u) {
                x[i] = 0.1 * (double)(chosen + i);
                references[count] = fmu_state_references[i];
                some[count] = x[i];
                count++;
            }
        }
        ASSERT_OK(fmu.SetReal(c, references, count, some));
        ASSERT_OK(fmu.GetDerivatives(c, dx, FMU_STATES));
        ASSERT_OK(fmu.SetContinuousStates(c, x, FMU_STATES));
        ASSERT_OK(fmu.GetDerivatives(c, expected, FMU_STATES));
        TEST_ASSERT_EQUAL_MEMORY(expected, dx, sizeof dx);
    }
    ASSERT_DISCARD(fmu_try_set(c, RP_MANIPULATOR_q2, NAN));
}

static void test_start_values_are_the_first_states(void) {
    double x[FMU_STATES] = {0};
    const fmi2Component c = fmu_instantiate_as(fmi2ModelExchange, &messages, false);
    fmu_set(c, RP_MANIPULATOR_q2, 0.25);
    fmu_enter_initialization(c, 3.0);
    fmu_set(c, RP_MANIPULATOR_dq1, -1.5);
    ASSERT_OK(fmu.GetContinuousStates(c, x, FMU_STATES));
    TEST_ASSERT_EQUAL_DOUBLE(0.25, x[1]);
    TEST_ASSERT_EQUAL_DOUBLE(-1.5, x[2]);
    TEST_ASSERT_EQUAL_DOUBLE(3.0, fmu_get(c, RP_MANIPULATOR_time));
}

static void test_nominals_are_positive(void) {
    double nominals[FMU_STATES] = {0};
    const fmi2Component c = fmu_me_initialized(&messages, 0.0);
    ASSERT_OK(fmu.GetNominalsOfContinuousStates(c, nominals, FMU_STATES));
    for (int i = 0; i < FMU_STATES; i++) {
        TEST_ASSERT_EQUAL_DOUBLE(1.0, nominals[i]); // none is declared
    }
}

/* Refused as a value of SetReal is: nothing changes. */
static void test_states_that_are_not_finite_are_discarded(void) {
    static const double bad[] = {NAN, INFINITY, -INFINITY};
    const double x[FMU_STATES] = {0.1, 0.2, 0.3, 0.4};
    const fmi2Component c = fmu_me_initialized(&messages, 0.0);
    ASSERT_OK(fmu.SetContinuousStates(c, x, FMU_STATES));
    for (size_t i = 0; i < FMU_COUNT(bad) * FMU_STATES; i++) {
        double wrong[FMU_STATES] = {1.0, 1.0, 1.0, 1.0};
        double got[FMU_STATES];
        wrong[i % FMU_STATES] = bad[i / FMU_STATES];
        fmu_log_clear(&messages);
        ASSERT_DISCARD(fmu.SetContinuousStates(c, wrong, FMU_STATES));
        TEST_ASSERT_EQUAL_UINT(1, messages.count[fmi2Discard]);
        ASSERT_OK(fmu.GetContinuousStates(c, got, FMU_STATES));
        TEST_ASSERT_EQUAL_MEMORY(x, got, sizeof x);
    }
    ASSERT_OK(fmu_me_step(c, 0.0, 0.01));
}

static void test_derivatives_that_overflow_are_discarded(void) {
    const double fast[FMU_STATES] = {0.0, 0.0, 1e200, 0.0};
    const double slow[FMU_STATES] = {0.0, 0.0, 1.0, 0.0};
    const double untouched[FMU_STATES] = {-1.5, -1.5, -1.5, -1.5};
    double dx[FMU_STATES];
    const fmi2Component c = fmu_me_initialized(&messages, 0.0);
    memcpy(dx, untouched, sizeof dx);
    ASSERT_OK(fmu.SetContinuousStates(c, fast, FMU_STATES));
    ASSERT_DISCARD(fmu.GetDerivatives(c, dx, FMU_STATES));
    TEST_ASSERT_EQUAL_MEMORY(untouched, dx, sizeof dx);
    TEST_ASSERT_GREATER_THAN_UINT(0, messages.count[fmi2Discard]);
    ASSERT_OK(fmu.SetContinuousStates(c, slow, FMU_STATES));
    ASSERT_OK(fmu.GetDerivatives(c, dx, FMU_STATES));
    TEST_ASSERT_EQUAL_DOUBLE(1.0, dx[0]);
}

/* ---- Arrays of the wrong size --------------------------------------------------------------- */

static const enum fmu_function array_functions[] = {
    FMU_SetContinuousStates,           FMU_GetContinuousStates, FMU_GetDerivatives,
    FMU_GetNominalsOfContinuousStates, FMU_GetEventIndicators,
};

#define CASE(name)                                                                                 \
    case FMU_##name:                                                                               \
        return fmu.name(c, x, count)

static fmi2Status call_with_array(enum fmu_function function, fmi2Component c, double *x,
                                  size_t count) {
    switch (function) {
        CASE(SetContinuousStates);
        CASE(GetContinuousStates);
        CASE(GetDerivatives);
        CASE(GetNominalsOfContinuousStates);
    default:
        return fmu.GetEventIndicators(c, x, count);
    }
}

static void test_wrong_sizes_and_missing_arrays_are_errors(void) {
    static const size_t counts[] = {0, 1, 3, 4, 5, 1000000, SIZE_MAX};
    for (size_t f = 0; f < FMU_COUNT(array_functions); f++) {
        const enum fmu_function function = array_functions[f];
        const size_t right = function == FMU_GetEventIndicators ? 0 : FMU_STATES;
        const char *name = fmu_name_of(function);
        for (size_t i = 0; i < 2 * FMU_COUNT(counts); i++) {
            const size_t count = counts[i / 2];
            const bool missing = i % 2 == 1;
            double x[FMU_STATES + 1] = {1.0, 1.0, 1.0, 1.0, 1.0};
            const fmi2Component c = fmu_me_initialized(&messages, 0.0);
            fmu_log_clear(&messages);
            const fmi2Status status = call_with_array(function, c, missing ? NULL : x, count);
            if (count == right && (!missing || right == 0)) {
                TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, status, name);
            } else {
                TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2Error, status, name);
                TEST_ASSERT_EQUAL_UINT(1, messages.count[fmi2Error]);
                fmu_assert_in_error(c);
                fmu_assert_reset_is_fresh_as(fmi2ModelExchange, c, name);
            }
            TEST_ASSERT_EQUAL_DOUBLE(1.0, x[FMU_STATES]);
            fmu_free(c);
        }
    }
}

/* ---- Time ----------------------------------------------------------------------------------- */

static void test_time_is_what_is_set(void) {
    static const double times[] = {0.5, 0.25, 0.0, 1e6, -3.0};
    for (int mode = fmu_version == 3 ? 1 : 0; mode < 2; mode++) { // FMI 3.0: not in event mode
        const fmi2Component c = mode == 0 ? in_event_mode() : fmu_me_initialized(&messages, 0.0);
        for (size_t i = 0; i < FMU_COUNT(times); i++) {
            ASSERT_OK(fmu.SetTime(c, times[i]));
            TEST_ASSERT_EQUAL_DOUBLE(times[i], fmu_get(c, RP_MANIPULATOR_time));
        }
    }
}

static void test_a_time_that_is_not_finite_is_refused(void) {
    static const double bad[] = {NAN, INFINITY, -INFINITY};
    for (size_t i = 0; i < FMU_COUNT(bad); i++) {
        const fmi2Component c = fmu_me_initialized(&messages, 1.0);
        const fmi2Status status = fmu.SetTime(c, bad[i]);
        TEST_ASSERT_TRUE(status == fmi2Discard || status == fmi2Error);
        TEST_ASSERT_EQUAL_UINT(1, messages.count[status]);
        TEST_ASSERT_EQUAL_DOUBLE(1.0, fmu_get(c, RP_MANIPULATOR_time));
        fmu_assert_reset_is_fresh_as(fmi2ModelExchange, c, "after a time that is not finite");
        fmu_log_clear(&messages);
    }
}

/* ---- Events --------------------------------------------------------------------------------- */

static void test_there_are_no_events(void) {
    const fmi2Component c = in_event_mode();
    for (int i = 0; i < 3; i++) {
        fmi2EventInfo info;
        memset(&info, 0x55, sizeof info); // every field is written
        ASSERT_OK(fmu.NewDiscreteStates(c, &info));
        TEST_ASSERT_EQUAL_INT(fmi2False, info.newDiscreteStatesNeeded);
        TEST_ASSERT_EQUAL_INT(fmi2False, info.terminateSimulation);
        TEST_ASSERT_EQUAL_INT(fmi2False, info.nominalsOfContinuousStatesChanged);
        TEST_ASSERT_EQUAL_INT(fmi2False, info.valuesOfContinuousStatesChanged);
        TEST_ASSERT_EQUAL_INT(fmi2False, info.nextEventTimeDefined);
        ASSERT_OK(fmu.EnterContinuousTimeMode(c));

        fmi2Boolean enter_event_mode = 7;
        fmi2Boolean terminate = 7;
        ASSERT_OK(fmu.CompletedIntegratorStep(c, i % 2, &enter_event_mode, &terminate));
        TEST_ASSERT_EQUAL_INT(fmi2False, enter_event_mode);
        TEST_ASSERT_EQUAL_INT(fmi2False, terminate);
        ASSERT_OK(fmu.EnterEventMode(c));
        if (fmu_version == 2) { // from itself too
            ASSERT_OK(fmu.EnterEventMode(c));
        }
    }
}
