#include "continuous_states.h"
#include "derivatives.h"
#include "instance.h"
#include "last_text.h"
#include "oscillator_by_hand.h"
#include "stepping.h"
#include "values.h"

#include <math.h>
#include <string.h>
#include <unity.h>

static struct instance *instance;

void setUp(void) {
    const struct instance_experiment experiment = {.start_time = 0.0};
    ASSERT_OK(instance_create(&oscillator_description, &last_text_sink, &instance));
    ASSERT_OK(instance_setup_experiment(instance, &experiment));
    ASSERT_OK(instance_enter_initialization(instance));
}

void tearDown(void) {
    instance_destroy(instance);
}

static double get(unsigned reference) {
    double value = NAN;
    ASSERT_OK(instance_get_real(instance, &reference, 1, &value));
    return value;
}

static void set_derivative(int order, double value) {
    const unsigned input = OSCILLATOR_U;
    ASSERT_OK(instance_set_input_derivatives(instance, &input, 1, &order, &value));
}

static double derivative(unsigned reference, int order) {
    double value = NAN;
    ASSERT_OK(instance_get_output_derivatives(instance, &reference, 1, &order, &value));
    return value;
}

/* x'' = -omega^2 x + u with u = b t + c t^2 / 2 + e t^3 / 6 has the particular solution
 * (u - u'' / omega^2) / omega^2, and so a solution in closed form. */
static void test_a_step_follows_the_polynomial(void) {
    const double b = 3.0;
    const double c = -8.0;
    const double e = 20.0;
    const double w = 2.0;
    const double t = 0.7;
    ASSERT_OK(instance_exit_initialization(instance));
    set_derivative(3, e);
    set_derivative(1, b);
    set_derivative(2, c);
    ASSERT_OK(instance_do_step(instance, 0.0, t));

    const double particular =
        (b * t + c * t * t / 2.0 + e * t * t * t / 6.0) / (w * w) - (c + e * t) / (w * w * w * w);
    const double x0 = 1.0 + c / (w * w * w * w);
    const double v0 = -b / (w * w) + e / (w * w * w * w);
    const double x = particular + x0 * cos(w * t) + v0 / w * sin(w * t);
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, x, get(OSCILLATOR_X));

    // outputs use the input at the end of the step, reading it gives the value set last
    const double u = b * t + c * t * t / 2.0 + e * t * t * t / 6.0;
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -w * w * get(OSCILLATOR_X) + u, get(OSCILLATOR_A));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get(OSCILLATOR_U));
}

static void test_derivatives_apply_to_one_step(void) {
    double exact[2];
    ASSERT_OK(instance_exit_initialization(instance));
    set_derivative(1, 100.0);
    ASSERT_OK(instance_do_step(instance, 0.0, 0.1));
    const double start[2] = {get(OSCILLATOR_X), get(OSCILLATOR_V)};
    ASSERT_OK(instance_do_step(instance, 0.1, 0.4));
    oscillator_solution(2.0, 0.0, 0.4, start, exact);
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, exact[0], get(OSCILLATOR_X));
}

static void test_output_derivatives_along_the_motion(void) {
    const double w = 2.0;
    ASSERT_OK(instance_exit_initialization(instance));
    set_derivative(1, 3.0);
    set_derivative(2, -8.0);
    ASSERT_OK(instance_do_step(instance, 0.0, 0.5));
    const double x = get(OSCILLATOR_X);
    const double v = get(OSCILLATOR_V);
    const double a = get(OSCILLATOR_A);
    const double du = 3.0 - 8.0 * 0.5;
    const double jerk = -w * w * v + du;
    TEST_ASSERT_EQUAL_DOUBLE(v, derivative(OSCILLATOR_X, 1));
    TEST_ASSERT_EQUAL_DOUBLE(a, derivative(OSCILLATOR_X, 2));
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, jerk, derivative(OSCILLATOR_V, 2));
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, -w * w * a - 8.0, derivative(OSCILLATOR_A, 2));
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, v * (a + w * w * x), derivative(OSCILLATOR_ENERGY, 1));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, a * a + v * jerk + w * w * (v * v + x * a),
                              derivative(OSCILLATOR_ENERGY, 2));
}

/* A value set after a step over which the input moved is held: its slope no longer counts. */
static void test_a_value_set_after_a_moving_step_has_no_slope(void) {
    const double w = 2.0;
    const unsigned input = OSCILLATOR_U;
    const double u = 0.25;
    ASSERT_OK(instance_exit_initialization(instance));
    set_derivative(1, 3.0);
    ASSERT_OK(instance_do_step(instance, 0.0, 0.5));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -w * w * get(OSCILLATOR_V) + 3.0, derivative(OSCILLATOR_A, 1));
    ASSERT_OK(instance_set_real(instance, &input, 1, &u));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -w * w * get(OSCILLATOR_V), derivative(OSCILLATOR_A, 1));
}

/* Once anything of an input is set after a step over which it moved, outputs answer for the input
 * that the next step will have: the value set last with the new derivatives. */
static void test_new_derivatives_start_from_the_value_set_last(void) {
    ASSERT_OK(instance_exit_initialization(instance));
    set_derivative(1, 3.0);
    set_derivative(2, -8.0);
    ASSERT_OK(instance_do_step(instance, 0.0, 0.5));
    set_derivative(1, 5.0);
    const double x = get(OSCILLATOR_X);
    TEST_ASSERT_EQUAL_DOUBLE(-4.0 * x, get(OSCILLATOR_A));
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, -4.0 * get(OSCILLATOR_V) + 5.0, derivative(OSCILLATOR_A, 1));
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, -4.0 * get(OSCILLATOR_A), derivative(OSCILLATOR_A, 2));
}

static void test_orders_and_variables_that_have_no_derivative_are_refused(void) {
    const unsigned wrong[] = {OSCILLATOR_TIME, OSCILLATOR_OMEGA, OSCILLATOR_U, OSCILLATOR_STEPS,
                              99};
    const int orders[] = {0, 3, -1};
    const unsigned x = OSCILLATOR_X;
    const unsigned u = OSCILLATOR_U;
    const int first = 1;
    const double one = 1.0;
    double value = -7.0;
    ASSERT_OK(instance_exit_initialization(instance));
    for (int i = 0; i < 5; i++) {
        TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT, instance_get_output_derivatives(
                                                           instance, &wrong[i], 1, &first, &value));
    }
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT,
                              instance_get_output_derivatives(instance, &x, 1, &orders[i], &value));
    }
    TEST_ASSERT_EQUAL_DOUBLE(-7.0, value);

    const int fourth = 4;
    const double nan = NAN;
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT,
                          instance_set_input_derivatives(instance, &u, 1, &fourth, &one));
    TEST_ASSERT_NOT_NULL(strstr(last_text, "an order from 1 to 3 is expected"));
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT,
                          instance_set_input_derivatives(instance, &x, 1, &first, &one));
    TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE,
                          instance_set_input_derivatives(instance, &u, 1, &first, &nan));
}

static void test_directional_derivatives(void) {
    const unsigned unknowns[] = {OSCILLATOR_A, OSCILLATOR_V, OSCILLATOR_X};
    const unsigned knowns[] = {OSCILLATOR_X, OSCILLATOR_U, OSCILLATOR_V};
    const double v[] = {0.5, 3.0, 7.0};
    double result[3];
    ASSERT_OK(instance_get_directional_derivative(instance, KNOWN_MOTION, unknowns, 3, knowns, 3, v,
                                                  result));
    TEST_ASSERT_EQUAL_DOUBLE(-4.0 * 0.5 + 3.0, result[0]);
    TEST_ASSERT_EQUAL_DOUBLE(7.0, result[1]);
    TEST_ASSERT_EQUAL_DOUBLE(0.5, result[2]);
}

static void test_knowns_and_unknowns_that_are_none_are_refused(void) {
    const unsigned x = OSCILLATOR_X;
    const unsigned omega = OSCILLATOR_OMEGA;
    const unsigned energy = OSCILLATOR_ENERGY;
    const unsigned setting = OSCILLATOR_EFFECTIVE_TOLERANCE;
    const double one = 1.0;
    double value = -7.0;
    ASSERT_OK(instance_get_directional_derivative(instance, KNOWN_MOTION, &x, 1, &omega, 1, &one,
                                                  &value));
    ASSERT_OK(instance_exit_initialization(instance));
    value = -7.0;
    const struct {
        const unsigned *unknown, *known;
    } cases[] = {{&x, &omega}, {&x, &energy}, {&omega, &x}, {&setting, &x}, {&x, &setting}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT, instance_get_directional_derivative(
                                                           instance, KNOWN_MOTION, cases[i].unknown,
                                                           1, cases[i].known, 1, &one, &value));
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(last_text, "is refused"), last_text);
    }
    TEST_ASSERT_EQUAL_DOUBLE(-7.0, value);
}

static void test_states_from_outside(void) {
    const double x[2] = {0.25, -1.5};
    double read[2];
    ASSERT_OK(instance_exit_initialization(instance));
    ASSERT_OK(instance_enter_continuous_time(instance));
    ASSERT_OK(instance_set_time(instance, 3.0));
    ASSERT_OK(instance_set_states(instance, x, 2));
    ASSERT_OK(instance_get_states(instance, read, 2));
    TEST_ASSERT_EQUAL_MEMORY(x, read, sizeof x);
    ASSERT_OK(instance_get_derivatives(instance, read, 2));
    TEST_ASSERT_EQUAL_DOUBLE(-1.5, read[0]);
    TEST_ASSERT_EQUAL_DOUBLE(-1.0, read[1]);
    ASSERT_OK(instance_get_nominals(instance, read, 2));
    TEST_ASSERT_EQUAL_DOUBLE(1.0, read[0]);
    TEST_ASSERT_EQUAL_DOUBLE(3.0, get(OSCILLATOR_TIME));

    const double wrong[2] = {0.0, NAN};
    TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE, instance_set_states(instance, wrong, 2));
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT, instance_set_states(instance, x, 1));
    TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE, instance_set_time(instance, INFINITY));
    TEST_ASSERT_EQUAL_DOUBLE(0.25, get(OSCILLATOR_X));

    const unsigned omega = OSCILLATOR_OMEGA;
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT, instance_set_real(instance, &omega, 1, x));
    instance_enter_event_mode(instance);
    const double negative = -1.0;
    ASSERT_OK(instance_set_real(instance, &omega, 1, &negative));
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_PARAMETERS, instance_enter_continuous_time(instance));
}
