/* What may be set in which mode, and what is checked where a mode ends. FMI 2.0, sections 3.2.3 and
 * 4.2.4. */
#include "fmu_harness.h"
#include "fmu_states.h"

#include <string.h>
#include <unity.h>

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
    const fmi2Component c = fmu_reach(type, fmu_state_of(type, letter), &messages);
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
