/* Setting and getting values: what is refused, and that a refused call changes nothing. FMI 2.0,
 * sections 2.1.7 and 4.2.4 (notes of the table). */
#include "fmu_harness.h"

#include <limits.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

/* What a call must not write over. */
static const double untouched = -12345.678;

static const enum fmu_function access_functions[] = {FMU_GetReal,    FMU_GetInteger, FMU_GetBoolean,
                                                     FMU_GetString,  FMU_SetReal,    FMU_SetInteger,
                                                     FMU_SetBoolean, FMU_SetString};

#define CASE(name)                                                                                 \
    case FMU_##name:                                                                               \
        return fmu.name(c, references, count, values)

/* Any of them by one signature; values are of the function's own type. */
static fmi2Status access(enum fmu_function function, fmi2Component c,
                         const fmi2ValueReference references[], size_t count, void *values) {
    switch (function) {
        CASE(GetReal);
        CASE(GetInteger);
        CASE(GetBoolean);
        CASE(GetString);
        CASE(SetReal);
        CASE(SetInteger);
        CASE(SetBoolean);
    default:
        return fmu.SetString(c, references, count, values);
    }
}

/* ---- Arguments ------------------------------------------------------------------------------ */

static void test_unknown_references_are_named(void) {
    static const fmi2ValueReference unknown[] = {9, 79, 1000, INT_MAX, 0x80000000u, UINT_MAX};
    for (size_t i = 0; i < FMU_COUNT(unknown); i++) {
        for (size_t f = 0; f < FMU_COUNT(access_functions); f++) {
            char number[16];
            double values[] = {untouched, untouched};
            const double before[] = {untouched, untouched};
            const fmi2Component c = fmu_initialized(&messages, 0.0);
            fmu_log_clear(&messages);
            ASSERT_ERROR(access(access_functions[f], c, &unknown[i], 1, values));
            TEST_ASSERT_EQUAL_MEMORY(before, values, sizeof before);
            snprintf(number, sizeof number, "%u", unknown[i]);
            fmu_assert_logged(&messages, number);
            fmu_assert_in_error(c);
            fmu_free(c);
        }
    }
}

static void test_type_mismatches_are_named(void) {
    static const struct {
        enum fmu_function function;
        fmi2ValueReference reference;
        const char *words[2]; /* of the message */
    } cases[] = {
        {FMU_GetInteger, RP_MANIPULATOR_q1, {"int32", "10"}},
        {FMU_GetBoolean, RP_MANIPULATOR_q1, {"boolean", "10"}},
        {FMU_GetString, RP_MANIPULATOR_q1, {"String", "10"}},
        {FMU_GetReal, RP_MANIPULATOR_solver_steps, {"float64", "80"}},
        {FMU_GetBoolean, RP_MANIPULATOR_solver_steps, {"boolean", "80"}},
        {FMU_SetInteger, RP_MANIPULATOR_tau1, {"int32", "20"}},
        {FMU_SetBoolean, RP_MANIPULATOR_tau1, {"boolean", "20"}},
        {FMU_SetString, RP_MANIPULATOR_tau1, {"String", "20"}},
        {FMU_SetReal, RP_MANIPULATOR_max_internal_steps, {"float64", "83"}},
        {FMU_SetReal, RP_MANIPULATOR_solver_method, {"float64", ""}},
    };
    for (size_t i = 0; i < FMU_COUNT(cases); i++) {
        double value = untouched;
        const fmi2Component c = fmu_instantiate(&messages, false);
        fmu_enter_initialization(c, 0);
        fmu_log_clear(&messages);
        ASSERT_ERROR(access(cases[i].function, c, &cases[i].reference, 1, &value));
        TEST_ASSERT_EQUAL_DOUBLE(untouched, value);
        fmu_assert_logged(&messages, cases[i].words[0]);
        fmu_assert_logged(&messages, cases[i].words[1]);
        fmu_assert_in_error(c);
        fmu_assert_reset_is_fresh(c, cases[i].words[0]);
        fmu_free(c);
    }
}

static void test_missing_arrays(void) {
    static const size_t counts[] = {1, 1000, SIZE_MAX / 2, SIZE_MAX};
    const fmi2ValueReference reference = RP_MANIPULATOR_tau1;
    double value = 0.0;
    for (size_t f = 0; f < FMU_COUNT(access_functions); f++) {
        const enum fmu_function function = access_functions[f];
        const fmi2Component c = fmu_initialized(&messages, 0.0);
        ASSERT_OK(access(function, c, NULL, 0, NULL));
        ASSERT_OK(access(function, c, &reference, 0, &value));
        for (size_t i = 0; i < FMU_COUNT(counts); i++) {
            const fmi2ValueReference *references[] = {NULL, NULL, &reference};
            double *values[] = {NULL, &value, NULL};
            for (size_t j = 0; j < FMU_COUNT(values); j++) {
                ASSERT_OK(fmu.Reset(c));
                fmu_initialize(c, 0.0, 0.0);
                fmu_log_clear(&messages);
                ASSERT_ERROR(access(function, c, references[j], counts[i], values[j]));
                fmu_assert_logged(&messages, "NULL");
                fmu_assert_logged(&messages, fmu_name_of(function));
                fmu_assert_in_error(c);
            }
        }
        fmu_free(c);
    }
}

static void test_a_vector_is_set_as_a_whole_or_not_at_all(void) {
    static const struct {
        fmi2ValueReference reference;
        double value;
        fmi2Status status;
    } bad[] = {
        {RP_MANIPULATOR_f2, NAN, fmi2Discard},
        {RP_MANIPULATOR_m1, -1.0, fmi2Discard},
        {RP_MANIPULATOR_q1, 1.0, fmi2Error},
        {RP_MANIPULATOR_solver_steps, 1.0, fmi2Error},
        {9999, 1.0, fmi2Error},
    };
    for (size_t i = 0; i < FMU_COUNT(bad); i++) {
        for (size_t position = 0; position < 3; position++) {
            fmi2ValueReference references[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_m2,
                                               RP_MANIPULATOR_g};
            double values[] = {5.0, 6.0, 7.0};
            double before[] = {1.0, 2.0, 3.0};
            double after[] = {untouched, untouched, untouched};
            const fmi2Component c = fmu_initialized(&messages, 0.0);
            ASSERT_OK(fmu.SetReal(c, references, 3, before));
            fmi2ValueReference mixed[3];
            memcpy(mixed, references, sizeof mixed);
            mixed[position] = bad[i].reference;
            values[position] = bad[i].value;
            TEST_ASSERT_EQUAL_INT(bad[i].status, fmu.SetReal(c, mixed, 3, values));
            ASSERT_OK(fmu.GetReal(c, references, 3, after));
            TEST_ASSERT_EQUAL_MEMORY(before, after, sizeof before);
            fmu_free(c);
        }
    }
}

static void test_a_vector_is_got_as_a_whole_or_not_at_all(void) {
    static const fmi2ValueReference bad[] = {9999, RP_MANIPULATOR_solver_steps};
    for (size_t i = 0; i < FMU_COUNT(bad); i++) {
        const fmi2ValueReference references[] = {RP_MANIPULATOR_q1, RP_MANIPULATOR_m1, bad[i]};
        const double before[] = {untouched, untouched, untouched};
        double values[] = {untouched, untouched, untouched};
        const fmi2Component c = fmu_initialized(&messages, 0.0);
        ASSERT_ERROR(fmu.GetReal(c, references, 3, values));
        TEST_ASSERT_EQUAL_MEMORY(before, values, sizeof before);
    }
}

/* ---- Values that are refused ---------------------------------------------------------------- */

static const struct refused_value {
    fmi2ValueReference reference;
    const char *name;
    double value;
    bool between_steps; /* the variable may be set then too */
} refused_values[] = {
    {RP_MANIPULATOR_tau1, "tau1", NAN, true},
    {RP_MANIPULATOR_tau1, "tau1", INFINITY, true},
    {RP_MANIPULATOR_f2, "f2", -INFINITY, true},
    {RP_MANIPULATOR_m1, "m1", -1.0, true},
    {RP_MANIPULATOR_m1, "m1", NAN, true},
    {RP_MANIPULATOR_m2, "m2", -1.0, true},
    {RP_MANIPULATOR_m2, "m2", 0.0, true},
    {RP_MANIPULATOR_m2, "m2", 0.999e-9, true},
    {RP_MANIPULATOR_I1z, "I1z", -1e-300, true},
    {RP_MANIPULATOR_I2z, "I2z", -0.1, true},
    {RP_MANIPULATOR_l1, "l1", -0.1, true},
    {RP_MANIPULATOR_lc1, "lc1", -INFINITY, true},
    {RP_MANIPULATOR_a, "a", NAN, true},
    {RP_MANIPULATOR_g, "g", INFINITY, true},
    {RP_MANIPULATOR_q1, "q1", NAN, false},
    {RP_MANIPULATOR_dq2, "dq2", -INFINITY, false},
    {RP_MANIPULATOR_relative_tolerance, "relative_tolerance", -1e-8, false},
    {RP_MANIPULATOR_relative_tolerance, "relative_tolerance", NAN, false},
    {RP_MANIPULATOR_max_step, "max_step", -1e-300, false},
    {RP_MANIPULATOR_max_step, "max_step", -INFINITY, false},
    {RP_MANIPULATOR_max_step, "max_step", INFINITY, false},
    {RP_MANIPULATOR_max_step, "max_step", NAN, false},
};

static void assert_discarded(fmi2Component c, const struct refused_value *refused, double old) {
    fmu_log_clear(&messages);
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2Discard, fmu_try_set(c, refused->reference, refused->value),
                                  refused->name);
    TEST_ASSERT_EQUAL_UINT(1, messages.count[fmi2Discard]);
    fmu_assert_logged(&messages, refused->name);
    fmu_assert_logged(&messages, "expected");
    TEST_ASSERT_TRUE_MESSAGE(old == fmu_get(c, refused->reference), refused->name);
}

static void test_values_out_of_range_are_discarded(void) {
    for (size_t i = 0; i < FMU_COUNT(refused_values); i++) {
        const struct refused_value *refused = &refused_values[i];
        const fmi2Component c = fmu_instantiate(&messages, false);
        ASSERT_DISCARD(fmu_try_set(c, refused->reference, refused->value));
        fmu_enter_initialization(c, 0);
        const double old = fmu_get(c, refused->reference);
        assert_discarded(c, refused, old);
        ASSERT_OK(fmu.ExitInitializationMode(c));
        if (refused->between_steps) {
            assert_discarded(c, refused, old);
        }
        ASSERT_OK(fmu.DoStep(c, 0.0, 0.1, fmi2True));
        fmu_assert_reset_is_fresh(c, refused->name);
        fmu_free(c);
    }
}

static void test_the_bounds_themselves_are_accepted(void) {
    static const fmi2ValueReference references[] = {RP_MANIPULATOR_m1, RP_MANIPULATOR_m2,
                                                    RP_MANIPULATOR_I2z, RP_MANIPULATOR_l1,
                                                    RP_MANIPULATOR_lc1};
    static const double values[] = {0.0, 1e-9, 0.0, 0.0, 0.0};
    const fmi2Component c = fmu_instantiate(&messages, false);
    ASSERT_OK(fmu.SetReal(c, references, FMU_COUNT(values), values));
    fmu_initialize(c, 0.0, 0.0);
    ASSERT_OK(fmu.DoStep(c, 0.0, 0.1, fmi2True));
}

static void test_an_integer_out_of_range_is_discarded(void) {
    static const struct {
        fmi2ValueReference reference;
        const char *name;
        fmi2Integer value;
    } refused[] = {
        {RP_MANIPULATOR_max_internal_steps, "max_internal_steps", 0},
        {RP_MANIPULATOR_max_internal_steps, "max_internal_steps", -1},
        {RP_MANIPULATOR_max_internal_steps, "max_internal_steps", INT_MIN},
        {RP_MANIPULATOR_solver_method, "solver_method", 0},
        {RP_MANIPULATOR_solver_method, "solver_method", 5},
        {RP_MANIPULATOR_solver_method, "solver_method", -1},
        {RP_MANIPULATOR_solver_method, "solver_method", INT_MAX},
        {RP_MANIPULATOR_solver_method, "solver_method", INT_MIN},
    };
    const fmi2Component c = fmu_instantiate(&messages, false);
    fmu_set_integer(c, RP_MANIPULATOR_solver_method, FMU_CVODE_BDF);
    for (size_t i = 0; i < FMU_COUNT(refused); i++) {
        fmu_log_clear(&messages);
        ASSERT_DISCARD(fmu.SetInteger(c, &refused[i].reference, 1, &refused[i].value));
        fmu_assert_logged(&messages, refused[i].name);
    }
    fmu_initialize(c, 0.0, 0.0);
    TEST_ASSERT_EQUAL_INT(100000, fmu_get_integer(c, RP_MANIPULATOR_max_internal_steps));
    TEST_ASSERT_EQUAL_INT(FMU_CVODE_BDF, fmu_get_integer(c, RP_MANIPULATOR_solver_method));
    fmu_assert_reset_is_fresh(c, "after methods that do not exist");
}
