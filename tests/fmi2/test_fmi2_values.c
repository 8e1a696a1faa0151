/* Setting and getting values: what is refused and that a refused call changes nothing, what may be
 * set in which mode, what is checked where a mode ends, and how results follow what is set between
 * steps. FMI 2.0, sections 2.1.7, 3.2.3, 4.2.1, 4.2.2 and 4.2.4. */
#include "fmi_states.h"
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

/* ---- What may be set ------------------------------------------------------------------------ */

/* Letters of the states in which the variable can be set, by kind: notes of the tables of sections
 * 4.2.4 and 3.2.3. Before initialization inputs, too, as importers set them. */
static const struct {
    fmi2ValueReference reference;
    const char *co_simulation, *model_exchange;
    const char *name;
} settable[] = {
    {RP_MANIPULATOR_tau1, "IMC", "IMVN", "tau1"},
    {RP_MANIPULATOR_f2, "IMC", "IMVN", "f2"},
    {RP_MANIPULATOR_m1, "IMC", "IMV", "m1"}, // tunable
    {RP_MANIPULATOR_g, "IMC", "IMV", "g"},
    {RP_MANIPULATOR_q1, "IM", "IMN", "q1"}, // a start value, then a state
    {RP_MANIPULATOR_dq2, "IM", "IMN", "dq2"},
    {RP_MANIPULATOR_relative_tolerance, "IM", "IM", "relative_tolerance"}, // fixed
    {RP_MANIPULATOR_max_internal_steps, "IM", "IM", "max_internal_steps"},
    {RP_MANIPULATOR_solver_method, "IM", "IM", "solver_method"},
    {RP_MANIPULATOR_solver_steps, "", "", "solver_steps"},
    {RP_MANIPULATOR_ddq1, "", "", "ddq1"},
    {RP_MANIPULATOR_time, "", "", "time"},
    {RP_MANIPULATOR_total_energy, "", "", "total_energy"},
    {RP_MANIPULATOR_tau1_y, "", "", "tau1_y"},
    {RP_MANIPULATOR_effective_relative_tolerance, "", "", "effective_relative_tolerance"},
};

/* FMI 3.0 sets states by this function in event mode, too. */
static bool is_state(fmi2ValueReference reference) {
    return reference >= RP_MANIPULATOR_q1 && reference <= RP_MANIPULATOR_dq2;
}

static bool is_integer(size_t row) {
    size_t i = 0;
    while (fmu_variables[i].reference != settable[row].reference) {
        i++;
    }
    return !fmu_variables[i].is_real;
}

static double get(fmi2Component c, size_t row) {
    return is_integer(row) ? fmu_get_integer(c, settable[row].reference)
                           : fmu_get(c, settable[row].reference);
}

static void check_settable(fmi2Type type, size_t row, char letter) {
    const fmi2ValueReference reference = settable[row].reference;
    const char *states =
        type == fmi2CoSimulation ? settable[row].co_simulation : settable[row].model_exchange;
    const bool allowed = strchr(states, letter) != NULL ||
                         (fmu_version == 3 && type == fmi2ModelExchange && is_state(reference));
    const double value = is_integer(row) ? 3.0 : 0.5;
    const fmi2Integer integer = 3;
    const fmi2Component c = fmu_reach(type, fmi_state_of(type, letter), &messages);
    const double expected = allowed || letter == 'I' ? value : get(c, row);
    const fmi2Status status = is_integer(row) ? fmu.SetInteger(c, &reference, 1, &integer)
                                              : fmu_try_set(c, reference, value);
    TEST_ASSERT_EQUAL_INT_MESSAGE(allowed ? fmi2OK : fmi2Error, status, settable[row].name);
    if (letter != 'I') {
        TEST_ASSERT_EQUAL_DOUBLE(expected, get(c, row));
    }
    if (!allowed) {
        const bool is_call_refused = is_integer(row) && letter == 'N'; // FMI 2.0
        fmu_assert_logged(&messages, is_call_refused ? "" : settable[row].name);
        fmu_assert_in_error(c);
    } else if (letter == 'I') {
        fmu_enter_initialization(c, 0);
        TEST_ASSERT_EQUAL_DOUBLE(value, get(c, row));
    }
    fmu_assert_reset_is_fresh_as(type, c, settable[row].name);
    fmu_free(c);
}

static void test_what_may_be_set_in_which_mode(void) {
    for (size_t row = 0; row < FMU_COUNT(settable); row++) {
        for (const char *letter = "IMC"; *letter != '\0'; letter++) {
            check_settable(fmi2CoSimulation, row, *letter);
        }
        for (const char *letter = "IMVN"; *letter != '\0'; letter++) {
            check_settable(fmi2ModelExchange, row, *letter);
        }
    }
}

static void test_parameters_tuned_at_an_event_keep_the_states(void) {
    double before[FMU_STATES];
    double after[FMU_STATES];
    double dx[FMU_STATES];
    double dx_fresh[FMU_STATES];
    const fmi2Component c = fmu_me_initialized(&messages, 0.0);
    ASSERT_OK(fmu_me_step(c, 0.0, 0.25));
    ASSERT_OK(fmu.GetContinuousStates(c, before, FMU_STATES));
    ASSERT_OK(fmu.EnterEventMode(c));
    fmu_set(c, RP_MANIPULATOR_m2, 2.5);
    ASSERT_OK(fmu.EnterContinuousTimeMode(c));
    ASSERT_OK(fmu.GetContinuousStates(c, after, FMU_STATES));
    TEST_ASSERT_EQUAL_MEMORY(before, after, sizeof before);
    ASSERT_OK(fmu.GetDerivatives(c, dx, FMU_STATES));

    const fmi2Component fresh = fmu_instantiate_as(fmi2ModelExchange, &messages, false);
    fmu_set(fresh, RP_MANIPULATOR_m2, 2.5);
    ASSERT_OK(fmu.SetReal(fresh, fmu_state_references, FMU_STATES, before));
    ASSERT_OK(fmu_me_enter_continuous_time(fresh, 0.25));
    ASSERT_OK(fmu.GetDerivatives(fresh, dx_fresh, FMU_STATES));
    TEST_ASSERT_EQUAL_MEMORY(dx_fresh, dx, sizeof dx);
}

static void set_no_inertia(fmi2Component c) {
    static const fmi2ValueReference references[] = {RP_MANIPULATOR_lc1, RP_MANIPULATOR_I1z,
                                                    RP_MANIPULATOR_I2z};
    static const double zeros[] = {0.0, 0.0, 0.0};
    ASSERT_OK(fmu.SetReal(c, references, 3, zeros));
}

static void assert_massless_is_told(fmi2Type type, fmi2Component c, const char *about) {
    static const char *const words[] = {"m1 = 2", "lc1 = 0", "I1z = 0", "I2z = 0"};
    for (size_t i = 0; i < FMU_COUNT(words); i++) {
        fmu_assert_logged(&messages, words[i]);
    }
    fmu_assert_in_error(c);
    fmu_assert_reset_is_fresh_as(type, c, about);
    fmu_log_clear(&messages);
}

/* The sum of the inertias is checked where a mode ends in which it can be set, and by a step. */
static void test_parameters_without_inertia_are_refused(void) {
    static const fmi2Type types[] = {fmi2CoSimulation, fmi2ModelExchange};
    for (size_t i = 0; i < FMU_COUNT(types); i++) {
        const fmi2Component c = fmu_instantiate_as(types[i], &messages, false);
        set_no_inertia(c);
        fmu_enter_initialization(c, 0);
        ASSERT_ERROR(fmu.ExitInitializationMode(c));
        assert_massless_is_told(types[i], c, "after an initialization without inertia");
    }
    const fmi2Component c = fmu_initialized(&messages, 0.0);
    ASSERT_OK(fmu.DoStep(c, 0.0, 0.1, fmi2True));
    set_no_inertia(c);
    ASSERT_ERROR(fmu.DoStep(c, 0.1, 0.1, fmi2True));
    assert_massless_is_told(fmi2CoSimulation, c, "after a step without inertia");

    const fmi2Component m = fmu_me_initialized(&messages, 0.0);
    ASSERT_OK(fmu.EnterEventMode(m));
    set_no_inertia(m);
    ASSERT_ERROR(fmu.EnterContinuousTimeMode(m));
    assert_massless_is_told(fmi2ModelExchange, m, "after an event without inertia");
}

/* ---- Results -----------------------------------------------------------------------------------
 */

static void test_get_after_set_answers_for_the_new_values(void) {
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
        fmu_set(c, RP_MANIPULATOR_m1, 2.0 + (double)i); // tunable
        fmu_set(c, RP_MANIPULATOR_l1, 0.5 + 0.1 * (double)i);
        fmu_assert_motion(c, inputs[i][0], inputs[i][1],
                          1e-12 * (10.0 + fabs(inputs[i][0]) + fabs(inputs[i][1])));
        fmu_get_states(c, after);
        TEST_ASSERT_EQUAL_MEMORY(before, after, sizeof before);
    }
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
