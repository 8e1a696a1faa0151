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
    static const fmi2Integer refused[] = {0, -1, INT_MIN};
    const fmi2ValueReference reference = RP_MANIPULATOR_max_internal_steps;
    const fmi2Component c = fmu_instantiate(&messages, false);
    for (size_t i = 0; i < FMU_COUNT(refused); i++) {
        ASSERT_DISCARD(fmu.SetInteger(c, &reference, 1, &refused[i]));
        fmu_assert_logged(&messages, "max_internal_steps");
    }
    fmi2Integer value = 0;
    fmu_initialize(c, 0.0, 0.0);
    ASSERT_OK(fmu.GetInteger(c, &reference, 1, &value));
    TEST_ASSERT_EQUAL_INT(100000, value);
}

static void make_massless(fmi2Component c) {
    static const fmi2ValueReference references[] = {RP_MANIPULATOR_lc1, RP_MANIPULATOR_I1z,
                                                    RP_MANIPULATOR_I2z};
    static const double zeros[] = {0.0, 0.0, 0.0};
    ASSERT_OK(fmu.SetReal(c, references, 3, zeros));
    fmu_log_clear(&messages);
}

static void assert_massless_is_told(fmi2Component c) {
    static const char *const words[] = {"m1 = 2", "lc1 = 0", "I1z = 0", "I2z = 0"};
    for (size_t i = 0; i < FMU_COUNT(words); i++) {
        fmu_assert_logged(&messages, words[i]);
    }
    fmu_assert_in_error(c);
    fmu_assert_reset_is_fresh(c, "after parameters without inertia");
}

static void test_no_inertia_at_the_end_of_initialization(void) {
    const fmi2Component c = fmu_instantiate(&messages, false);
    make_massless(c);
    fmu_enter_initialization(c, 0);
    ASSERT_ERROR(fmu.ExitInitializationMode(c));
    assert_massless_is_told(c);
}

static void test_no_inertia_between_steps(void) {
    const fmi2Component c = fmu_initialized(&messages, 0.0);
    ASSERT_OK(fmu.DoStep(c, 0.0, 0.1, fmi2True));
    make_massless(c);
    ASSERT_ERROR(fmu.DoStep(c, 0.1, 0.1, fmi2True));
    assert_massless_is_told(c);
}

/* ---- What may be set when ------------------------------------------------------------------- */

static void test_what_cannot_be_set_between_steps(void) {
    static const struct {
        fmi2ValueReference reference;
        const char *name;
    } cases[] = {
        {RP_MANIPULATOR_time, "time"},
        {RP_MANIPULATOR_q1, "q1"},
        {RP_MANIPULATOR_dq2, "dq2"},
        {RP_MANIPULATOR_ddq1, "ddq1"},
        {RP_MANIPULATOR_ee_x, "ee_x"},
        {RP_MANIPULATOR_total_energy, "total_energy"},
        {RP_MANIPULATOR_D11, "D11"},
        {RP_MANIPULATOR_tau1_y, "tau1_y"},
        {RP_MANIPULATOR_relative_tolerance, "relative_tolerance"},
        {RP_MANIPULATOR_effective_relative_tolerance, "effective_relative_tolerance"},
    };
    for (size_t i = 0; i < FMU_COUNT(cases); i++) {
        const fmi2Component c = fmu_initialized(&messages, 0.0);
        const double old = fmu_get(c, cases[i].reference);
        fmu_log_clear(&messages);
        TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2Error, fmu_try_set(c, cases[i].reference, 0.125),
                                      cases[i].name);
        fmu_assert_logged(&messages, cases[i].name);
        TEST_ASSERT_TRUE(old == fmu_get(c, cases[i].reference));
        fmu_assert_in_error(c);
        fmu_assert_reset_is_fresh(c, cases[i].name);
        fmu_free(c);
    }
    const fmi2ValueReference integers[] = {RP_MANIPULATOR_solver_steps,
                                           RP_MANIPULATOR_max_internal_steps};
    for (size_t i = 0; i < FMU_COUNT(integers); i++) {
        const fmi2Integer value = 5;
        const fmi2Component c = fmu_initialized(&messages, 0.0);
        ASSERT_ERROR(fmu.SetInteger(c, &integers[i], 1, &value));
    }
}

static void test_what_is_calculated_cannot_be_set_before_either(void) {
    static const fmi2ValueReference calculated[] = {
        RP_MANIPULATOR_time, RP_MANIPULATOR_ddq2, RP_MANIPULATOR_kinetic_energy,
        RP_MANIPULATOR_coriolis1, RP_MANIPULATOR_effective_relative_tolerance};
    for (size_t i = 0; i < FMU_COUNT(calculated); i++) {
        const fmi2Component c = fmu_instantiate(&messages, false);
        ASSERT_ERROR(fmu_try_set(c, calculated[i], 1.0));
        fmu_assert_in_error(c);
    }
}

/* Inputs before initialization: section 4.2.4 lists variables with a start value, importers set
 * inputs too. */
static void test_start_values_and_inputs_are_accepted_before_steps(void) {
    static const fmi2ValueReference references[] = {
        RP_MANIPULATOR_m1,  RP_MANIPULATOR_m2,   RP_MANIPULATOR_I1z,
        RP_MANIPULATOR_I2z, RP_MANIPULATOR_l1,   RP_MANIPULATOR_lc1,
        RP_MANIPULATOR_a,   RP_MANIPULATOR_g,    RP_MANIPULATOR_q1,
        RP_MANIPULATOR_q2,  RP_MANIPULATOR_dq1,  RP_MANIPULATOR_dq2,
        RP_MANIPULATOR_f2,  RP_MANIPULATOR_tau1, RP_MANIPULATOR_relative_tolerance};
    const fmi2Component c = fmu_instantiate(&messages, false);
    for (size_t i = 0; i < FMU_COUNT(references); i++) {
        fmu_set(c, references[i], 0.25 + 0.125 * (double)i);
    }
    fmu_enter_initialization(c, 0);
    for (size_t i = 0; i < FMU_COUNT(references); i++) {
        TEST_ASSERT_TRUE(0.25 + 0.125 * (double)i == fmu_get(c, references[i]));
        fmu_set(c, references[i], 0.5);
        TEST_ASSERT_TRUE(0.5 == fmu_get(c, references[i]));
    }
    ASSERT_OK(fmu.ExitInitializationMode(c));
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, fmu_log_total(&messages), messages.texts);
}

static void test_every_variable_is_readable_in_initialization_mode(void) {
    const fmi2Component c = fmu_instantiate(&messages, false);
    fmu_enter_initialization(c, 0);
    for (size_t i = 0; i < fmu_variable_count; i++) {
        double real = NAN;
        fmi2Integer integer = -1;
        TEST_ASSERT_EQUAL_INT_MESSAGE(
            fmi2OK,
            fmu_variables[i].is_real ? fmu.GetReal(c, &fmu_variables[i].reference, 1, &real)
                                     : fmu.GetInteger(c, &fmu_variables[i].reference, 1, &integer),
            messages.texts);
        TEST_ASSERT_TRUE(fmu_variables[i].is_real ? isfinite(real) : integer >= 0);
    }
}
