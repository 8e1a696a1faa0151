/* The drives: braking, ends of the numbers and refusals.
 * test_actuator.py compares values with the equations. */
#include "rp_actuator.h"
#include "rp_test_support.h"
#include "run_instance.h"
#include "value_references.h"

#include <float.h>
#include <string.h>

void setUp(void) {
    create_instance();
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

static const struct drive drive = {1.0, 1.0, 0.5, 32.0, 1e3, 1.0};

static void test_not_a_number_is_not_limited(void) {
    TEST_ASSERT_TRUE(isnan(drive_limited_current(&drive, NAN, 1.0)));
    TEST_ASSERT_FALSE(isnan(drive_limited_current(&drive, 0.5, 2.0)));
}

/* A command or a back-EMF that overflows is only very large. */
static void test_what_overflows_meets_the_limit(void) {
    set(RP_ACTUATOR_gear_ratio1, 1e-9);
    set(RP_ACTUATOR_tau1_cmd, DBL_MAX);
    set(RP_ACTUATOR_gear_ratio2, 1e9);
    set(RP_ACTUATOR_dq2, DBL_MAX);
    initialize(0.0);
    step_to(0.01);
    TEST_ASSERT_TRUE(get(RP_ACTUATOR_current1_limited) == get(RP_ACTUATOR_current_max1));
    TEST_ASSERT_TRUE(get(RP_ACTUATOR_current2_limited) == -get(RP_ACTUATOR_current_max2));
}

/* ---- What is refused ------------------------------------------------------------------------ */

static void test_gears_without_a_ratio_are_refused(void) {
    const double ratios[] = {1e-9, -1e-9, 0.0, 9e-10, -5e-10};
    for (int i = 0; i < 10; i++) {
        instance_reset(instance);
        set(i < 5 ? RP_ACTUATOR_gear_ratio1 : RP_ACTUATOR_gear_ratio2, ratios[i % 5]);
        const struct instance_experiment experiment = {0};
        ASSERT_OK(instance_setup_experiment(instance, &experiment));
        ASSERT_OK(instance_enter_initialization(instance));
        const enum status status = instance_exit_initialization(instance);
        TEST_ASSERT_EQUAL_INT(i % 5 < 2 ? STATUS_OK : STATUS_INVALID_PARAMETERS, status);
        if (status != STATUS_OK) {
            const char *name = i < 5 ? "gear_ratio1" : "gear_ratio2";
            TEST_ASSERT_NOT_NULL(strstr(last_text, name));
        }
    }
}
