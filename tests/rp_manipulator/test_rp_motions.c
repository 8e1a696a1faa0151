/* Motions of the arm at values so extreme that the integrator's own arithmetic underflows or
 * overflows: a step is right or refused, never wrong. */
#include "each_method.h"
#include "run_instance.h"
#include "value_references.h"

#include <float.h>

void setUp(void) {
    create_instance();
}

static void begin(void) {
    set_integer(RP_MANIPULATOR_solver_method, method);
    initialize(0.0);
}

/* The horizontal plane without offset: only link 2 moves, at constant velocity or acceleration. */
static void start_sliding(double dq2, double f2) {
    instance_reset(instance);
    set(RP_MANIPULATOR_g, 0.0);
    set(RP_MANIPULATOR_a, 0.0);
    set(RP_MANIPULATOR_dq2, dq2);
    set(RP_MANIPULATOR_f2, f2);
    begin();
}

EACH_METHOD static void test_a_huge_speed_is_integrated_or_refused(void) {
    for (int exponent = 0; exponent <= 304; exponent += 4) {
        const double dq2 = pow(10.0, exponent);
        const double h = 1e-3;
        start_sliding(dq2, 0.0);
        const enum status status = instance_do_step(instance, 0.0, h, NULL);
        TEST_ASSERT_TRUE(status_severity(status) <= SEVERITY_DISCARD);
        TEST_ASSERT_DOUBLE_WITHIN(1e-7 * dq2 * h, dq2 * instance_time(instance),
                                  get(RP_MANIPULATOR_q2));
        // ARKODE gives up where its first guess of a step is too long by more than it may shrink it
        TEST_ASSERT_TRUE(status == STATUS_OK || exponent > (method == INTEGRATOR_ERK ? 40 : 100));
    }
}

EACH_METHOD static void test_a_huge_force_is_integrated_or_refused(void) {
    for (int exponent = 0; exponent <= 304; exponent += 4) {
        const double f2 = pow(10.0, exponent);
        start_sliding(0.0, f2);
        for (int i = 0; i < 3; i++) {
            const enum status status =
                instance_do_step(instance, instance_time(instance), 2e-3, NULL);
            const double t = instance_time(instance);
            TEST_ASSERT_TRUE(status_severity(status) <= SEVERITY_DISCARD);
            TEST_ASSERT_DOUBLE_WITHIN(1e-7 * f2 * 4e-6, 0.5 * f2 * t * t, get(RP_MANIPULATOR_q2));
            if (status != STATUS_OK) {
                break;
            }
        }
    }
}

EACH_METHOD static void test_tiny_steps_are_done_or_refused(void) {
    for (int exponent = -323; exponent <= -1; exponent++) {
        const double h = pow(10.0, exponent);
        start_sliding(1.0, 0.0);
        const enum status status = instance_do_step(instance, 0.0, h, NULL);
        TEST_ASSERT_TRUE(status_severity(status) <= SEVERITY_DISCARD);
        TEST_ASSERT_DOUBLE_WITHIN(1e-7 * h + DBL_TRUE_MIN, instance_time(instance),
                                  get(RP_MANIPULATOR_q2));
        // solvers square their step, which underflows below 1e-150 s; erk refuses such steps
        TEST_ASSERT_TRUE(status == STATUS_OK ||
                         exponent < (method == INTEGRATOR_ERK ? -100 : -150));
        if (method <= INTEGRATOR_CVODE_BDF && exponent < -150) {
            // the same step with an observer would take another number of internal steps
            TEST_ASSERT_EQUAL_INT(STATUS_NO_CONVERGENCE, status);
        }
    }
}

EACH_METHOD static void test_the_state_is_that_of_the_time_reached(void) {
    set(RP_MANIPULATOR_l1, 1e212);
    set(RP_MANIPULATOR_g, -9e-20);
    begin();
    const enum status status = instance_do_step(instance, 0.0, 4e209, NULL);
    // the arm is so long that it does not move: CVODE does not find that
    const bool finds = method == INTEGRATOR_ERK || method == INTEGRATOR_TAYLOR;
    TEST_ASSERT_EQUAL_INT(finds ? SEVERITY_NONE : SEVERITY_DISCARD, status_severity(status));
    TEST_ASSERT_EQUAL_DOUBLE(finds ? 4e209 : 0.0, instance_time(instance));
    TEST_ASSERT_TRUE(isfinite(get(RP_MANIPULATOR_q1)) && isfinite(get(RP_MANIPULATOR_q2)));
}
