/* The controller: limits, and the integral part through the instance and the integrator.
 * test_controller.py compares values with sympy. */
#include "derivatives.h"
#include "rp_controller_law.h"
#include "rp_controller_model.h"
#include "rp_test_support.h"
#include "run_instance.h"
#include "value_references.h"

void setUp(void) {
    create_instance();
}

/* ---- The law -------------------------------------------------------------------------------- */

static void test_efforts_stay_within_their_limits(void) {
    const struct rp_controller_parameters p = {.limit = {3.0, 0.0}};
    const double cases[][4] = {
        {3.5, 1e-300, 3.0, 0.0},     {-3.5, -1e-300, -3.0, -0.0},  {3.0, 0.0, 3.0, 0.0},
        {2.75, INFINITY, 2.75, 0.0}, {-INFINITY, -4.0, -3.0, 0.0}, {-2.75, 0.0, -2.75, 0.0},
    };
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        for (int i = 0; i < 2; i++) {
            TEST_ASSERT_TRUE(law_limited(&p, cases[k][i], i) == cases[k][2 + i]);
        }
    }
    TEST_ASSERT_TRUE(isnan(law_limited(&p, NAN, 0)) && isnan(law_limited(&p, NAN, 1)));
}

/* ---- The integral part ---------------------------------------------------------------------- */

/* PD of joint 1, by itself: u = M (Kp e + Kd de + w). */
static const double M = 0.75, Kp = 50.0, Kd = 8.0, Ki = 240.0, Tt = 0.125, limit = 30.0;
static const double e = 0.25, de = -0.5;

static void start(double gain, double tracking_time, double w) {
    set_integer(RP_CONTROLLER_mode, RP_CONTROLLER_PD);
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

/* Below the limit w' = Ki e: a ramp. At w = edge the effort meets the limit; from there on
 * w' = Ki e - (w - edge) / Tt, which ends at edge + Ki e Tt. */
static double edge_of(double error) {
    return limit / M - Kp * error - Kd * de;
}

static double into_the_limit(double w, double t) {
    const double edge = edge_of(e);
    const double hit = (edge - w) / (Ki * e);
    return t < hit ? w + Ki * e * t : edge + Ki * e * Tt * -expm1(-(t - hit) / Tt);
}

static double out_of_the_limit(double w, double t) {
    const double edge = edge_of(-e);
    const double rest = edge - Ki * e * Tt;
    const double left = Tt * log((w - rest) / (edge - rest));
    return t < left ? rest + (w - rest) * exp(-t / Tt) : edge - Ki * e * (t - left);
}

static void test_integral_ramps_up_and_meets_the_limit(void) {
    start(Ki, Tt, 2.0);
    for (int i = 1; i <= 100; i++) {
        step_to(0.0137 * i);
        const double w = get(RP_CONTROLLER_integral1);
        ASSERT_CLOSE(into_the_limit(2.0, instance_time(instance)), w, 1e-9);
        const double unlimited = M * (Kp * e + Kd * de + w);
        ASSERT_CLOSE(unlimited, get(RP_CONTROLLER_tau1_unlimited), 1e-13);
        TEST_ASSERT_TRUE(get(RP_CONTROLLER_tau1) == fmin(get(RP_CONTROLLER_tau1_unlimited), limit));
    }
}

static void test_integral_decays_out_of_the_limit_and_ramps_down(void) {
    start(Ki, Tt, 150.0);
    set(RP_CONTROLLER_q1_ref, -e);
    for (int i = 1; i <= 100; i++) {
        step_to(0.0137 * i);
        ASSERT_CLOSE(out_of_the_limit(150.0, instance_time(instance)), get(RP_CONTROLLER_integral1),
                     1e-9);
    }
    TEST_ASSERT_TRUE(get(RP_CONTROLLER_tau1) < limit);
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

static void test_integral_rests_without_gain(void) {
    const double held[] = {0.1, 1234.5}; // below the limit and beyond it
    for (int k = 0; k < 2; k++) {
        instance_reset(instance);
        set(RP_CONTROLLER_Ki2, 100.0); // the other joint moves
        set(RP_CONTROLLER_q2_ref, 1.0);
        start(0.0, Tt, held[k]);
        for (int i = 1; i <= 20; i++) {
            step_to(0.05 * i);
            TEST_ASSERT_TRUE(get(RP_CONTROLLER_integral1) == held[k]);
            TEST_ASSERT_TRUE(get(RP_CONTROLLER_dintegral1) == 0.0);
        }
        TEST_ASSERT_TRUE(fabs(get(RP_CONTROLLER_integral2)) > 1.0);
    }
}

/* The error runs as e + r t + b t^2 / 2 over the step, by derivatives of two inputs. */
static void test_integral_follows_extrapolated_inputs(void) {
    const double r = 0.5, b = -3.0, h = 0.25;
    start(Ki, Tt, 1.0);
    set(RP_CONTROLLER_tau1_max, 1e6);
    const unsigned references[] = {RP_CONTROLLER_q1_ref, RP_CONTROLLER_q1_ref, RP_CONTROLLER_q1};
    const int orders[] = {1, 2, 1};
    const double derivatives[] = {r - 1.0, b, -1.0};
    ASSERT_OK(instance_set_input_derivatives(instance, references, 3, orders, derivatives));
    step_to(h);
    ASSERT_CLOSE(1.0 + Ki * (e * h + r * h * h / 2.0 + b * h * h * h / 6.0),
                 get(RP_CONTROLLER_integral1), 1e-10);
}

/* A master that adds up milliseconds is 1e-9 s off after 334 585 of them: the effort is that of the
 * step at whose end the sample was due, with a delay that of the one before. */
static void test_every_sample_of_a_master_that_sums_its_steps(void) {
    static const double h = 1e-3;
    set(RP_CONTROLLER_sample_time, h);
    set(RP_CONTROLLER_delay, h);
    set_integer(RP_CONTROLLER_mode, RP_CONTROLLER_PD);
    set(RP_CONTROLLER_Kp1, 1.0);
    set(RP_CONTROLLER_Kd1, 0.0);
    set(RP_CONTROLLER_inertia1, 1.0);
    set(RP_CONTROLLER_tau1_max, 1e9);
    initialize(0.0);
    double t = 0.0;
    for (int i = 1; i <= 500000; i++) {
        set(RP_CONTROLLER_q1_ref, i);
        ASSERT_OK(instance_do_step(instance, t, h));
        t += h;
        TEST_ASSERT_TRUE(get(RP_CONTROLLER_tau1) == i - 1);
    }
}
