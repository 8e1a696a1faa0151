/* The drives: braking, ends of the numbers and refusals.
 * test_actuator.py compares values with the equations. */
#include "model_test.h"
#include "rp_actuator_equations.h"
#include "rp_actuator_model.h"
#include "rp_test_support.h"
#include "run_instance.h"
#include "value_references.h"

#include <float.h>
#include <stdio.h>

static struct rp_actuator_values at;

void setUp(void) {
    create_instance();
    at = (struct rp_actuator_values){
        .parameters = {{1.0, 1.5}, {0.5, 1.5}, {1.0, 2.0}, {32.0, 48.0}, {1e3, 2e3}, {1.0, 0.5}},
        .inputs = {{1.5, 0.5}, {1.0, 2.0}},
    };
}

/* Drive of joint 1. k and n are powers of two, so that commands of whole currents are exact. */
static const double k = 0.0625, n = 64.0, R = 0.75, i_max = 8.0, u_max = 24.0, T = 0.004;
static const double nk = 4.0;

static void start_at(double current) {
    set(RP_ACTUATOR_torque_constant1, k);
    set(RP_ACTUATOR_gear_ratio1, n);
    set(RP_ACTUATOR_resistance1, R);
    set(RP_ACTUATOR_current_max1, i_max);
    set(RP_ACTUATOR_voltage_max1, u_max);
    set(RP_ACTUATOR_time_constant1, T);
    set(RP_ACTUATOR_current1, current);
    initialize(1e-11);
}

/* ---- Limits --------------------------------------------------------------------------------- */

/* Beyond the no-load speed no voltage of the drive holds the current at 0: it brakes. Once even
 * i_max is too small for the range of the voltage, the current stays at i_max and the voltage is
 * what both make. */
static void test_beyond_the_no_load_speed_the_drive_brakes(void) {
    const double no_load = u_max / nk, last = (u_max + R * i_max) / nk;
    const double commands[] = {0.0, 20.0, 1e6, -nk};
    for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++) {
        instance_reset(instance);
        set(RP_ACTUATOR_tau1_cmd, commands[i]);
        set(RP_ACTUATOR_dq1, 0.5 * (no_load + last));
        start_at(0.0);
        step_to(40.0 * T);
        ASSERT_CLOSE(-0.5 * i_max, get(RP_ACTUATOR_current1), 1e-9);
        ASSERT_CLOSE(u_max, get(RP_ACTUATOR_voltage1), 1e-9);

        set(RP_ACTUATOR_dq1, 2.0 * last);
        TEST_ASSERT_TRUE(get(RP_ACTUATOR_current1_limited) == -i_max);
        step_to(80.0 * T);
        ASSERT_CLOSE(-i_max, get(RP_ACTUATOR_current1), 1e-9);
        ASSERT_CLOSE(2.0 * u_max + R * i_max, get(RP_ACTUATOR_voltage1), 1e-8);
    }
}

/* ---- Ends of the numbers --------------------------------------------------------------------- */

static void test_not_a_number_is_not_limited(void) {
    at.inputs.effort_cmd[0] = NAN;
    TEST_ASSERT_TRUE(isnan(drive_limited_current(&at.parameters, &at.inputs, 0)));
    TEST_ASSERT_FALSE(isnan(drive_limited_current(&at.parameters, &at.inputs, 1)));
}

/* A command or a back-EMF that overflows is only very large. */
static void test_what_overflows_meets_the_limit(void) {
    struct rp_actuator_parameters *p = &at.parameters;
    p->gear_ratio[0] = 1e-9;
    at.inputs.effort_cmd[0] = DBL_MAX;
    p->gear_ratio[1] = 1e9;
    at.inputs.dq[1] = DBL_MAX;
    TEST_ASSERT_TRUE(drive_limited_current(p, &at.inputs, 0) == p->current_max[0]);
    TEST_ASSERT_TRUE(drive_limited_current(p, &at.inputs, 1) == -p->current_max[1]);
}

/* ---- What is refused ------------------------------------------------------------------------ */

static void test_gears_without_a_ratio_are_refused(void) {
    double *ratio = at.parameters.gear_ratio;
    ratio[0] = -1e-9;
    ratio[1] = 1e-9;
    model_test_accepted(&rp_actuator_model, &at);
    const struct {
        double ratio;
        const char *text;
    } wrong[] = {{0.0, "0"}, {9e-10, "9e-10"}, {-5e-10, "-5e-10"}, {NAN, "nan"}};
    for (int i = 0; i < 8; i++) {
        char expected[128];
        ratio[0] = ratio[1] = 1.0;
        ratio[i / 4] = wrong[i % 4].ratio;
        (void)snprintf(expected, sizeof expected,
                       "gear_ratio%d = %s is refused: its magnitude must be 1e-09 or more",
                       i / 4 + 1, wrong[i % 4].text);
        model_test_refused(&rp_actuator_model, &at, expected);
    }
}
