#include "each_method.h"
#include "integrator_test.h"

#include <stdlib.h>

static enum status always_failing(double t, const double x[], double dx[], void *context) {
    memcpy(dx, x, 2 * sizeof(double));
    return STATUS_OUT_OF_RANGE;
}

static enum status series_always_failing(double t, double time_scale, int first, int last,
                                         double row[][SERIES_LENGTH], void *context) {
    for (int k = first; k <= last; k++) {
        row[0][k] = 0.0;
        row[1][k] = 0.0;
    }
    return STATUS_OUT_OF_RANGE;
}

static struct circle circle;
static struct integrator *integrator;
static long step_limit;
static int message_count;
static enum status message_status;

static void count_message(void *context, enum status status, const char *text) {
    TEST_ASSERT_EQUAL_PTR(&circle, context);
    TEST_ASSERT_TRUE(strlen(text) > 0);
    message_status = status;
    message_count++;
}

static const double start[2] = {1.0, 0.0};

static void create(ode_rhs *rhs, ode_series *series) {
    const struct ode ode = {.state_count = 2,
                            .rhs = rhs,
                            .jacobian = circle_jacobian,
                            .series = series,
                            .series_row_count = 2,
                            .context = &circle};
    const struct message_sink sink = {.write = count_message, .context = &circle};
    ASSERT_OK(integrator_create(&ode, &sink, &integrator));
}

static void configure(double tolerance) {
    configure_integrator(integrator, method, tolerance, 0.0);
}

static void restart(double horizon) {
    ASSERT_OK(
        integrator_restart(integrator, start, &(struct integrator_start){.horizon = horizon}));
}

static void advance(double t, double x[2]) {
    double reached;
    ASSERT_OK(integrator_advance(integrator, t, step_limit, &reached, x));
    TEST_ASSERT_EQUAL_DOUBLE(t, reached);
}

void setUp(void) {
    circle = (struct circle){.failing_from = INFINITY};
    message_count = 0;
    step_limit = 100000;
    create(circle_rhs, circle_series);
    configure(1e-10);
}

void tearDown(void) {
    integrator_destroy(integrator);
}

EACH_METHOD static void test_the_error_follows_the_tolerance(void) {
    double coarse = INFINITY;
    for (int digits = 4; digits <= 12; digits += 2) {
        double x[2];
        configure(pow(10.0, -digits));
        restart(INFINITY);
        advance(10.0, x);
        const double error = hypot(x[0] - cos(10.0), x[1] + sin(10.0));
        // the circle neither grows nor damps errors: at worst all steps' local errors add up
        struct integrator_statistics statistics;
        integrator_get_statistics(integrator, &statistics);
        TEST_ASSERT_TRUE(error < sqrt(2.0) * (double)statistics.steps * pow(10.0, -digits));
        TEST_ASSERT_TRUE(error < coarse);
        coarse = error;
    }
}

/* To the bit: other stops do not matter, and cost no steps. */
EACH_CVODE_METHOD static void test_many_points_lie_where_each_lies_alone(void) {
    enum { POINTS = 300 };
    // otherwise the first step depends on the first point
    const struct integrator_start first = {.horizon = INFINITY, .first_step = 1e-6};
    double many[POINTS][2];
    ASSERT_OK(integrator_restart(integrator, start, &first));
    for (int i = 0; i < POINTS; i++) {
        advance(0.01 * (i + 1), many[i]);
    }
    for (int i = 0; i < POINTS; i++) {
        double alone[2];
        ASSERT_OK(integrator_restart(integrator, start, &first));
        advance(0.01 * (i + 1), alone);
        TEST_ASSERT_EQUAL_MEMORY(alone, many[i], sizeof alone);
    }
}

EACH_METHOD static void test_nothing_is_evaluated_beyond_the_horizon(void) {
    double x[2];
    restart(1.0);
    for (int i = 1; i <= 100; i++) {
        advance(0.01 * i, x);
    }
    TEST_ASSERT_TRUE(circle.latest <= 1.0 + 1e-12);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, cos(1.0), x[0]);

    // a later restart without a horizon is not bound by the former one
    restart(INFINITY);
    advance(2.0, x);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, cos(2.0), x[0]);
}

/* What a snapshot relies on: where the stops were in between does not matter. */
EACH_CVODE_METHOD static void test_a_run_can_be_repeated_with_two_stops(void) {
    double x[2];
    double repeated[2];
    struct integrator_statistics first;
    struct integrator_statistics second;
    restart(7.0);
    for (int i = 1; i <= 60; i++) {
        advance(0.1 * i, x);
    }
    integrator_get_statistics(integrator, &first);

    restart(7.0);
    advance(0.1, repeated);
    advance(0.1 * 60, repeated);
    TEST_ASSERT_EQUAL_MEMORY(x, repeated, sizeof x);
    integrator_set_statistics(integrator, &first);

    // and continue alike
    for (int i = 61; i <= 70; i++) {
        advance(fmin(0.1 * i, 7.0), repeated);
    }
    integrator_get_statistics(integrator, &second);
    configure(1e-10);
    restart(7.0);
    for (int i = 1; i <= 70; i++) {
        advance(fmin(0.1 * i, 7.0), x);
    }
    TEST_ASSERT_EQUAL_MEMORY(x, repeated, sizeof x);
    struct integrator_statistics whole;
    integrator_get_statistics(integrator, &whole);
    TEST_ASSERT_EQUAL_MEMORY(&whole, &second, sizeof whole);
}

EACH_METHOD static void test_statistics_add_up_over_restarts(void) {
    double x[2];
    struct integrator_statistics once;
    struct integrator_statistics thrice;
    restart(INFINITY);
    advance(1.0, x);
    integrator_get_statistics(integrator, &once);
    TEST_ASSERT_TRUE(once.steps > 0);
    TEST_ASSERT_EQUAL_INT(circle.evaluations, once.rhs_evaluations);

    for (int i = 0; i < 2; i++) {
        restart(INFINITY);
        advance(1.0, x);
    }
    integrator_get_statistics(integrator, &thrice);
    TEST_ASSERT_EQUAL_INT(3 * once.steps, thrice.steps);
    TEST_ASSERT_EQUAL_INT(circle.evaluations, thrice.rhs_evaluations);

    configure(1e-10);
    integrator_get_statistics(integrator, &once);
    TEST_ASSERT_EQUAL_INT(0, once.steps);
}

EACH_METHOD static void test_too_many_steps_leave_a_valid_state(void) {
    double x[2];
    double reached;
    configure(1e-10);
    step_limit = 20;
    restart(INFINITY);
    TEST_ASSERT_EQUAL_INT(STATUS_TOO_MANY_STEPS,
                          integrator_advance(integrator, 100.0, step_limit, &reached, x));
    TEST_ASSERT_TRUE(reached > 0.0 && reached < 100.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, cos(reached), x[0]);
    TEST_ASSERT_TRUE(message_count > 0);
    TEST_ASSERT_EQUAL_INT(STATUS_TOO_MANY_STEPS, message_status);
}

/* The Taylor method sees it where an internal step begins. */
EACH_METHOD static void test_a_right_hand_side_that_fails_on_the_way_ends_the_step_before(void) {
    double x[2];
    double reached;
    configure_integrator(integrator, method, 1e-10, 0.25);
    circle.failing_from = 1.0;
    restart(INFINITY);
    TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE,
                          integrator_advance(integrator, 2.0, step_limit, &reached, x));
    TEST_ASSERT_TRUE(reached > 0.5 && reached <= 1.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, cos(reached), x[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, -sin(reached), x[1]);
}

EACH_METHOD static void test_a_right_hand_side_that_fails_at_once_leaves_the_state(void) {
    double x[2];
    double reached;
    struct integrator_statistics before;
    struct integrator_statistics after;
    restart(INFINITY);
    advance(1.0, x);
    integrator_get_statistics(integrator, &before);
    circle.failing_from = 0.0;
    restart(INFINITY);
    TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE,
                          integrator_advance(integrator, 2.0, step_limit, &reached, x));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, reached);
    TEST_ASSERT_EQUAL_MEMORY(start, x, sizeof start);
    integrator_get_statistics(integrator, &after);
    TEST_ASSERT_EQUAL_DOUBLE(before.last_step, after.last_step); // the last that was taken

    integrator_destroy(integrator);
    create(always_failing, series_always_failing);
    configure(1e-10);
    restart(INFINITY);
    TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE,
                          integrator_advance(integrator, 2.0, step_limit, &reached, x));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, reached);
}

/* After an advance the first step of a restart has an estimated error of order 1, h^2 x'' / 2, of a
 * hundredth of the tolerance: 0.1 sqrt(2 / norm), norm the weighted root mean square of x'' = -x.
 */
EACH_CVODE_METHOD static void test_the_next_step_follows_from_the_second_derivative(void) {
    double x[2];
    restart(INFINITY);
    for (int i = 1; i < 12; i++) {
        const double t = 0.5 * i;
        advance(t, x);
        double sum = 0.0;
        for (int k = 0; k < 2; k++) {
            const double weighted = x[k] / (1e-10 * fabs(x[k]) + 1e-12);
            sum += weighted * weighted;
        }
        const double expected = 0.1 * sqrt(2.0 / sqrt(sum / 2.0));
        TEST_ASSERT_DOUBLE_WITHIN(0.02 * expected, expected, integrator_next_step(integrator));
    }
}

/* An advance that is no multiple of the step is taken in parts of equal length: none is tried that
 * the error test must refuse. */
EACH_METHOD static void test_advances_need_no_second_attempt(void) {
    struct integrator_statistics statistics;
    double x[2];
    double t = 1.0;
    restart(INFINITY);
    advance(t, x);
    integrator_get_statistics(integrator, &statistics);
    const int64_t failed = statistics.failed_steps;
    for (int i = 0; i < 50; i++) {
        t += 2.3 *
             (method == INTEGRATOR_ERK ? integrator_next_step(integrator) : statistics.last_step);
        advance(t, x);
        integrator_get_statistics(integrator, &statistics);
    }
    TEST_ASSERT_LESS_OR_EQUAL_INT(failed + 5, statistics.failed_steps);
}

/* Whatever state the one before ended with. */
EACH_METHOD static void test_another_method_may_take_over(void) {
    static const double not_finite[2] = {NAN, INFINITY};
    const double absolute[2] = {1e-12, 1e-12};
    double x[2];
    double expected[2];
    restart(INFINITY);
    advance(1.0, expected);
    for (enum integrator_method other = INTEGRATOR_CVODE_ADAMS; other < INTEGRATOR_METHODS;
         other++) {
        const struct integrator_settings settings = {
            .method = other, .relative_tolerance = 1e-10, .absolute_tolerances = absolute};
        ASSERT_OK(integrator_configure(integrator, &settings));
        ASSERT_OK(integrator_restart(integrator, not_finite,
                                     &(struct integrator_start){.horizon = INFINITY}));
    }
    configure(1e-10);
    restart(INFINITY);
    advance(1.0, x);
    TEST_ASSERT_EQUAL_MEMORY(expected, x, sizeof x);
}

EACH_METHOD static void test_a_vanishing_step_ends_in_the_same_way_each_time(void) {
    static const double lengths[] = {5e-324, 1e-300, 1e-200};
    for (size_t i = 0; i < sizeof lengths / sizeof lengths[0]; i++) {
        enum status statuses[2];
        int64_t evaluations[2];
        for (int k = 0; k < 2; k++) {
            struct integrator_statistics statistics;
            double x[2];
            double reached;
            configure(1e-8);
            restart(INFINITY);
            statuses[k] = integrator_advance(integrator, lengths[i], step_limit, &reached, x);
            integrator_get_statistics(integrator, &statistics);
            evaluations[k] = statistics.rhs_evaluations;
        }
        TEST_ASSERT_EQUAL_INT(statuses[0], statuses[1]);
        TEST_ASSERT_EQUAL_INT(evaluations[0], evaluations[1]);
    }
}

/* ---- First steps ---------------------------------------------------------------------------- */

/* A spring that is pushed. */
static double stiffness;
static double push;

static enum status spring_rhs(double t, const double x[], double dx[], void *context) {
    dx[0] = x[1];
    dx[1] = push - stiffness * x[0];
    return STATUS_OK;
}

static enum status spring_jacobian(double t, const double x[], double J[], void *context) {
    const double columns[4] = {0.0, -stiffness, 1.0, 0.0};
    memcpy(J, columns, sizeof columns);
    return STATUS_OK;
}

static void create_spring(double stiffness_of, double push_of) {
    const struct ode ode = {
        .state_count = 2, .rhs = spring_rhs, .jacobian = spring_jacobian, .indicator_count = 1};
    stiffness = stiffness_of;
    push = push_of;
    integrator_destroy(integrator);
    ASSERT_OK(integrator_create(&ode, &last_text_sink, &integrator));
    configure(1e-8);
}

/* Where the spring begins decides how the norm of the derivatives overflows. */
EACH_CVODE_METHOD static void test_derivatives_that_are_too_large_are_named(void) {
    double x[2];
    double reached;
    if (method == INTEGRATOR_CVODE_BDF) {
        return; // its first right-hand sides are not finite
    }
    create_spring(1e300, 0.0);
    restart(INFINITY);
    TEST_ASSERT_EQUAL_INT(STATUS_NO_CONVERGENCE,
                          integrator_advance(integrator, 1.0, 1000, &reached, x));
    TEST_ASSERT_EQUAL_STRING("cvode_adams: the derivatives of the states are too large for a first "
                             "step",
                             last_text);
    TEST_ASSERT_TRUE(reached == 0.0 && x[0] == 1.0 && x[1] == 0.0);
}

static bool end_at_first_step(void *context, double t, const double x[]) {
    *(double *)context = t;
    return true;
}

/* After an event its error h^2 x'' / 2 is 0.003^2 of the tolerance, whatever the velocity. */
EACH_CVODE_METHOD static void test_the_first_step_after_an_event_follows_from_the_curvature(void) {
    const struct indicator far = {.kind = INDICATOR_OF_STATE, .factor = 1.0, .offset = 1e9};
    const struct integrator_start from = {
        .horizon = INFINITY, .continues = true, .indicators = &far};
    const double expected = 0.003 * sqrt(2.0 * sqrt(2.0) * (1e-8 + 1e-10) / 8.0);
    double first = 0.0;
    create_spring(0.0, 8.0);
    integrator_set_observer(integrator, end_at_first_step, &first);
    for (double velocity = 0.0; velocity < 100.0; velocity += 30.0) {
        const double thrown[2] = {1.0, velocity};
        double x[2];
        double reached;
        ASSERT_OK(integrator_restart(integrator, thrown, &from));
        ASSERT_OK(integrator_advance(integrator, 1.0, 1000, &reached, x));
        TEST_ASSERT_DOUBLE_WITHIN(1e-3 * expected, expected, first);
    }
}
