/* Between initialization and Terminate an instance allocates memory only for FMU states. Steps, and
 * setting or getting values, allocate nothing, with any method and after any failure. */
#include "allocator.h"
#include "each_method.h"
#include "fmu_harness.h"
#include "fmu_sequences.h"

#include <math.h>
#include <unity.h>

static const double h = 0.01; // s

static fmi2Status set_inputs(fmi2Component c, double tau1, double f2) {
    const fmi2ValueReference references[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2};
    const double values[] = {tau1, f2};
    return fmu.SetReal(c, references, 2, values);
}

static fmi2Status set_slopes(fmi2Component c, int i) {
    const fmi2ValueReference references[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2};
    const fmi2Integer orders[] = {1 + i % 3, 1};
    const double values[] = {3.0, -1.0};
    return fmu.SetRealInputDerivatives(c, references, 2, orders, values);
}

/* Sets some values before step i. */
typedef fmi2Status change(fmi2Component c, int i);

static fmi2Status change_nothing(fmi2Component c, int i) {
    return fmi2OK;
}

static fmi2Status change_inputs(fmi2Component c, int i) {
    return set_inputs(c, sin(0.1 * i), 10.0 + cos(0.1 * i));
}

static fmi2Status change_parameters(fmi2Component c, int i) {
    const fmi2ValueReference reference = RP_MANIPULATOR_m2;
    const double value = 1.0 + 0.01 * (i % 5);
    return fmu.SetReal(c, &reference, 1, &value);
}

static void assert_steps_allocate_nothing(fmi2Component c, double start, change *change_values) {
    struct fmu_values values;
    fmi2Status status = fmi2OK;
    const long before = allocator_calls();
    for (int i = 0; i < 200 && status == fmi2OK; i++) {
        status = change_values(c, i);
        if (status == fmi2OK) {
            status = fmu.DoStep(c, start + i * h, h, fmi2True);
        }
        if (status == fmi2OK) {
            status = fmu_get_all(c, &values);
        }
    }
    TEST_ASSERT_EQUAL_INT(before, allocator_calls());
    ASSERT_OK(status);
}

EACH_METHOD static void test_the_allocations_of_the_fmu_are_counted(void) {
    const long before = allocator_calls();
    const fmi2Component c = fmu_initialized_with(method, &messages, 0.0);
    const long initialized = allocator_calls();
    TEST_ASSERT_GREATER_THAN_INT(before, initialized);
    fmi2FMUstate state = fmu_save(c);
    TEST_ASSERT_GREATER_THAN_INT(initialized, allocator_calls());
    fmu_forget(c, &state);
}

EACH_METHOD static void test_steps_and_values_allocate_nothing(void) {
    static change *const each[] = {change_nothing, change_inputs, set_slopes, change_parameters};
    for (size_t i = 0; i < FMU_COUNT(each); i++) {
        const fmi2Component c = fmu_initialized_with(method, &messages, 0.0);
        assert_steps_allocate_nothing(c, 0.0, each[i]);
        // and in any order
        for (size_t j = 0; j < FMU_COUNT(each); j++) {
            assert_steps_allocate_nothing(c, (double)(j + 1) * 200.0 * h, each[j]);
        }
        fmu_free(c);
    }
}

/* Thousands of internal steps, past where the integrator restarts by itself. */
EACH_METHOD static void test_a_long_hold_allocates_nothing(void) {
    const double length = 20.0;
    const fmi2Component c = fmu_lasting(method, &messages);
    const long before = allocator_calls();
    fmi2Status status = fmi2OK;
    for (int i = 0; i < 2 && status == fmi2OK; i++) {
        status = fmu.DoStep(c, i * length, length, fmi2True);
    }
    TEST_ASSERT_EQUAL_INT(before, allocator_calls());
    ASSERT_OK(status);
    TEST_ASSERT_GREATER_THAN_INT(1, fmu_get_integer(c, RP_MANIPULATOR_solver_restarts));
    assert_steps_allocate_nothing(c, 2.0 * length, change_nothing);
}

/* The history is replayed, or the integrator is replaced by one with the state's method. */
EACH_METHOD static void test_steps_after_a_rollback_allocate_nothing(void) {
    for (fmi2Integer other = FMU_CVODE_ADAMS; other < FMU_METHODS; other++) {
        const fmi2Component source = fmu_initialized_with(method, &messages, 0.0);
        assert_steps_allocate_nothing(source, 0.0, change_nothing);
        fmi2FMUstate state = fmu_save(source);
        struct fmu_bytes bytes = fmu_serialize(source, state);
        assert_steps_allocate_nothing(source, 200.0 * h, change_inputs);
        const long before = allocator_calls();
        const fmi2Status status = fmu.SetFMUstate(source, state);
        TEST_ASSERT_EQUAL_INT(before, allocator_calls());
        ASSERT_OK(status);
        assert_steps_allocate_nothing(source, 200.0 * h, change_nothing);

        const fmi2Component c = fmu_initialized_with(other, &messages, 0.0);
        fmu_restore_bytes(c, &bytes);
        assert_steps_allocate_nothing(c, 200.0 * h, change_nothing);
        fmu_bytes_free(&bytes);
        fmu_free(source);
        fmu_free(c);
    }
}

EACH_METHOD static void test_what_is_refused_allocates_nothing(void) {
    const fmi2ValueReference reference = RP_MANIPULATOR_tau1;
    const double not_a_number = NAN;
    const fmi2Component c = fmu_initialized_with(method, &messages, 0.0);
    fmi2FMUstate state = fmu_save(c);
    const long before = allocator_calls();
    const fmi2Status discarded = fmu.SetReal(c, &reference, 1, &not_a_number);
    const fmi2Status step_back = fmu.DoStep(c, -1.0, h, fmi2True);
    const fmi2Status in_error = fmu.DoStep(c, 0.0, h, fmi2True);
    const fmi2Status restored = fmu.SetFMUstate(c, state);
    TEST_ASSERT_EQUAL_INT(before, allocator_calls());
    ASSERT_DISCARD(discarded);
    ASSERT_ERROR(step_back);
    ASSERT_ERROR(in_error);
    ASSERT_OK(restored);
    assert_steps_allocate_nothing(c, 0.0, change_inputs);
}

/* For want of internal steps, and at a slope that overflows: messages of the solver are passed on.
 */
EACH_METHOD static void test_a_step_that_fails_allocates_nothing(void) {
    for (int overflows = 0; overflows < 2; overflows++) {
        const fmi2Component c = fmu_instantiate(&messages, false);
        fmu_set_integer(c, RP_MANIPULATOR_solver_method, method);
        fmu_set_integer(c, RP_MANIPULATOR_max_internal_steps, method == FMU_TAYLOR ? 10 : 100);
        fmu_initialize(c, 0.0, 0.0);
        assert_steps_allocate_nothing(c, 0.0, change_inputs);
        fmi2FMUstate state = fmu_save(c);
        fmu_set(c, RP_MANIPULATOR_tau1, overflows ? 1.7e308 : 1.0);
        const long before = allocator_calls();
        const fmi2Status failed = fmu.DoStep(c, 200.0 * h, 1000.0, fmi2True);
        const fmi2Status restored = fmu.SetFMUstate(c, state);
        TEST_ASSERT_EQUAL_INT(before, allocator_calls());
        ASSERT_DISCARD(failed);
        ASSERT_OK(restored);
        assert_steps_allocate_nothing(c, 200.0 * h, change_inputs);
        fmu_free(c);
    }
}
