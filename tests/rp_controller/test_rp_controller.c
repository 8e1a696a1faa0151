/* The controller: limits, and the integral part through the instance and the integrator.
 * test_controller.py compares values with sympy. */
#include "rp_controller.h"
#include "rp_test_support.h"
#include "run_instance.h"
#include "value_references.h"

void setUp(void) {
    create_instance();
}

/* ---- The law -------------------------------------------------------------------------------- */

static void test_efforts_stay_within_their_limits(void) {
    static const double limits[2] = {3.0, 0.0};
    const double cases[][4] = {
        {3.5, 1e-300, 3.0, 0.0},     {-3.5, -1e-300, -3.0, -0.0},  {3.0, 0.0, 3.0, 0.0},
        {2.75, INFINITY, 2.75, 0.0}, {-INFINITY, -4.0, -3.0, 0.0}, {-2.75, 0.0, -2.75, 0.0},
    };
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        for (int i = 0; i < 2; i++) {
            TEST_ASSERT_TRUE(law_limited(cases[k][i], limits[i]) == cases[k][2 + i]);
        }
    }
    TEST_ASSERT_TRUE(isnan(law_limited(NAN, 3.0)) && isnan(law_limited(NAN, 0.0)));
}

/* ---- The integral part ---------------------------------------------------------------------- */

/* PD of joint 1, by itself: u = M (Kp e + Kd de + w). */
static const double M = 0.75, Kp = 50.0, Kd = 8.0, Ki = 240.0, Tt = 0.125, limit = 30.0;
static const double e = 0.25, de = -0.5;

static void start(double gain, double tracking_time, double w) {
    set_integer(RP_CONTROLLER_mode, RP_CONTROLLER_MODE_PD);
    set(RP_CONTROLLER_inertia1, M);
    set(RP_CONTROLLER_Kp1, Kp);
    set(RP_CONTROLLER_Kd1, Kd);
    set(RP_CONTROLLER_Ki1, gain);
    set(RP_CONTROLLER_tracking_time, tracking_time);
    set(RP_CONTROLLER_tau1_max, limit);
    set(RP_CONTROLLER_integral1, w);
    set(RP_CONTROLLER_q1_ref, e);
    set(RP_CONTROLLER_dq1, -de);
    initialize(1e-11);
}

/* Returns the w at which the effort meets the limit. Below it w' = Ki e; from there on
 * w' = Ki e - (w - edge) / Tt, which ends at edge + Ki e Tt. */
static double edge_of(double error) {
    return limit / M - Kp * error - Kd * de;
}

/* After 5 s at the limit the error changes its sign. With back-calculation the effort leaves the
 * limit at once, because Ki Tt < 2 Kp. Without (a tracking time beyond all others) the integral has
 * grown to Ki e 5 s and must first come down again by the same law. */
static void test_effort_leaves_the_limit_without_delay(void) {
    start(Ki, Tt, 0.0);
    step_to(5.0);
    TEST_ASSERT_TRUE(get(RP_CONTROLLER_tau1) == limit);
    set(RP_CONTROLLER_q1_ref, -e);
    ASSERT_CLOSE(limit + M * (Ki * Tt - 2.0 * Kp) * e, get(RP_CONTROLLER_tau1), 1e-9);
    TEST_ASSERT_TRUE(get(RP_CONTROLLER_tau1) < limit);

    instance_reset(instance);
    start(Ki, 1e12, 0.0);
    step_to(5.0);
    set(RP_CONTROLLER_q1_ref, -e);
    const double delay = (Ki * e * 5.0 - edge_of(-e)) / (Ki * e);
    TEST_ASSERT_TRUE(delay > 3.0);
    step_to(5.0 + 0.999 * delay);
    TEST_ASSERT_TRUE(get(RP_CONTROLLER_tau1) == limit);
    step_to(5.0 + 1.001 * delay);
    TEST_ASSERT_TRUE(get(RP_CONTROLLER_tau1) < limit);
}
