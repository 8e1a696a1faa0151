/* Model Exchange: what may be set in which mode, and instances of both kinds side by side.
 * Rollback: test_fmi2_snapshots.c and test_faults_memory.c. FMI 2.0, section 3.2.3. */
#include "fmu_harness.h"
#include "fmu_states.h"

#include <string.h>
#include <unity.h>

/* ---- What may be set ------------------------------------------------------------------------ */

/* Letters of the modes in which the variable can be set: notes of the table of section 3.2.3. */
static const struct {
    fmi2ValueReference reference;
    const char *modes;
    const char *name;
} settable[] = {
    {RP_MANIPULATOR_tau1, "IMVN", "tau1"},
    {RP_MANIPULATOR_f2, "IMVN", "f2"},
    {RP_MANIPULATOR_m1, "IMV", "m1"}, // tunable
    {RP_MANIPULATOR_g, "IMV", "g"},
    {RP_MANIPULATOR_q1, "IMN", "q1"}, // a start value, then a state
    {RP_MANIPULATOR_dq2, "IMN", "dq2"},
    {RP_MANIPULATOR_relative_tolerance, "IM", "relative_tolerance"}, // fixed
    {RP_MANIPULATOR_ddq1, "", "ddq1"},
    {RP_MANIPULATOR_time, "", "time"},
    {RP_MANIPULATOR_total_energy, "", "total_energy"},
    {RP_MANIPULATOR_D11, "", "D11"},
};

/* FMI 3.0 sets states by this function in event mode, too. */
static bool is_state(fmi2ValueReference reference) {
    return reference >= RP_MANIPULATOR_q1 && reference <= RP_MANIPULATOR_dq2;
}

static void test_what_may_be_set_in_which_mode(void) {
    static const char modes[] = "IMVN";
    for (size_t i = 0; i < FMU_COUNT(settable); i++) {
        for (const char *mode = modes; *mode != '\0'; mode++) {
            const fmi2Component c =
                fmu_reach(fmi2ModelExchange, fmu_state_of(fmi2ModelExchange, *mode), &messages);
            const bool allowed = strchr(settable[i].modes, *mode) != NULL ||
                                 (fmu_version == 3 && is_state(settable[i].reference));
            const fmi2Status status = fmu_try_set(c, settable[i].reference, 0.5);
            TEST_ASSERT_EQUAL_INT_MESSAGE(allowed ? fmi2OK : fmi2Error, status, settable[i].name);
            if (!allowed) {
                fmu_assert_logged(&messages, settable[i].name);
                fmu_assert_in_error(c);
            } else if (*mode != 'I') {
                TEST_ASSERT_EQUAL_DOUBLE(0.5, fmu_get(c, settable[i].reference));
            }
            fmu_free(c);
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

/* The sum of the inertias is checked where a mode ends in which it can be set. */
static void test_parameters_without_inertia_are_refused(void) {
    fmi2Component c = fmu_instantiate_as(fmi2ModelExchange, &messages, false);
    set_no_inertia(c);
    fmu_enter_initialization(c, 0);
    ASSERT_ERROR(fmu.ExitInitializationMode(c));
    fmu_assert_logged(&messages, "lc1 = 0");
    fmu_assert_reset_is_fresh_as(fmi2ModelExchange, c, "after an initialization without inertia");

    fmu_log_clear(&messages);
    c = fmu_me_initialized(&messages, 0.0);
    ASSERT_OK(fmu.EnterEventMode(c));
    set_no_inertia(c);
    ASSERT_ERROR(fmu.EnterContinuousTimeMode(c));
    fmu_assert_logged(&messages, "lc1 = 0");
    fmu_assert_reset_is_fresh_as(fmi2ModelExchange, c, "after an event without inertia");
}

/* ---- Both kinds ----------------------------------------------------------------------------- */

static void test_both_kinds_side_by_side(void) {
    static struct fmu_run alone[2];
    static struct fmu_run together[2];
    const fmi2Component own = fmu_instantiate(&messages, false);
    const fmi2Component other = fmu_instantiate_as(fmi2ModelExchange, &messages, false);
    ASSERT_OK(fmu_run(own, 2, &alone[0]));
    ASSERT_OK(fmu_run_as(fmi2ModelExchange, other, 2, &alone[1]));
    fmu_free(own);
    fmu_free(other);

    memset(together, 0, sizeof together);
    const fmi2Component c = fmu_instantiate(&messages, false);
    const fmi2Component m = fmu_instantiate_as(fmi2ModelExchange, &messages, false);
    ASSERT_OK(fmu_run_start(fmi2CoSimulation, c, 2));
    ASSERT_OK(fmu_run_start(fmi2ModelExchange, m, 2));
    for (unsigned i = 0; i < FMU_RUN_STEPS; i++) {
        ASSERT_OK(fmu_run_step(fmi2CoSimulation, c, i, &together[0]));
        ASSERT_OK(fmu_run_step(fmi2ModelExchange, m, i, &together[1]));
    }
    TEST_ASSERT_EQUAL_MEMORY(alone, together, sizeof alone);
}

static void test_reset_keeps_the_kind(void) {
    const fmi2Component c = fmu_me_initialized(&messages, 0.0);
    ASSERT_OK(fmu.Reset(c));
    ASSERT_OK(fmu_me_enter_continuous_time(c, 0.0));
    ASSERT_ERROR(fmu.DoStep(c, 0.0, 0.1, fmi2True));
    fmu_assert_reset_is_fresh_as(fmi2ModelExchange, c, "after a reset");
}
