/* What every method does: errors, stops, statistics, failures, first steps, and who watches it. */
#include "each_method.h"
#include "integrator_test.h"

#include <stdlib.h>

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

static void create(size_t indicators) {
    const struct ode ode = {.state_count = 2,
                            .rhs = circle_rhs,
                            .jacobian = circle_jacobian,
                            .series = circle_series,
                            .series_row_count = 2,
                            .indicator_count = indicators,
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

static struct integrator_statistics statistics(void) {
    return *integrator_totals(integrator);
}

void setUp(void) {
    circle = (struct circle){.failing_from = INFINITY};
    message_count = 0;
    step_limit = 100000;
    create(0);
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
        TEST_ASSERT_TRUE(error < sqrt(2.0) * (double)statistics().steps * pow(10.0, -digits));
        TEST_ASSERT_TRUE(error < coarse);
        coarse = error;
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

/* What a snapshot relies on: from any two of the stops on a run goes on to the bit as from all of
 * them. */
EACH_CVODE_METHOD static void test_stops_in_between_do_not_matter(void) {
    enum { STOPS = 70 };
    // otherwise the first step depends on the first stop
    const struct integrator_start first = {.horizon = 7.0, .first_step = 1e-6};
    struct integrator_statistics all[STOPS];
    double expected[STOPS][2];
    ASSERT_OK(integrator_restart(integrator, start, &first));
    for (int i = 0; i < STOPS; i++) {
        advance(fmin(0.1 * (i + 1), 7.0), expected[i]);
        all[i] = *integrator_totals(integrator);
    }
    for (int i = 0; i < STOPS; i++) {
        struct integrator_statistics found;
        double x[2];
        configure(1e-10);
        ASSERT_OK(integrator_restart(integrator, start, &first));
        advance(fmin(0.1 * (i + 1), 7.0), x);
        TEST_ASSERT_EQUAL_MEMORY(expected[i], x, sizeof x);
        *integrator_totals(integrator) = all[i];
        advance(7.0, x);
        found = *integrator_totals(integrator);
        TEST_ASSERT_EQUAL_MEMORY(expected[STOPS - 1], x, sizeof x);
        TEST_ASSERT_EQUAL_MEMORY(&all[STOPS - 1], &found, sizeof found);
    }
}

EACH_METHOD static void test_statistics_add_up_over_restarts(void) {
    double x[2];
    restart(INFINITY);
    advance(1.0, x);
    const struct integrator_statistics once = statistics();
    TEST_ASSERT_TRUE(once.steps > 0);
    TEST_ASSERT_EQUAL_INT(circle.evaluations, once.rhs_evaluations);

    for (int i = 0; i < 2; i++) {
        restart(INFINITY);
        advance(1.0, x);
    }
    TEST_ASSERT_EQUAL_INT(3 * once.steps, statistics().steps);
    TEST_ASSERT_EQUAL_INT(circle.evaluations, statistics().rhs_evaluations);

    // where no step is possible, those of the last that was taken stay
    double reached;
    circle.failing_from = 0.0;
    restart(INFINITY);
    TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE,
                          integrator_advance(integrator, 2.0, step_limit, &reached, x));
    TEST_ASSERT_EQUAL_DOUBLE(once.last_step, statistics().last_step);
    configure(1e-10);
    TEST_ASSERT_EQUAL_INT(0, statistics().steps);
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
    double x[2];
    double t = 1.0;
    restart(INFINITY);
    advance(t, x);
    const int64_t failed = statistics().failed_steps;
    for (int i = 0; i < 50; i++) {
        t += 2.3 *
             (method == INTEGRATOR_ERK ? integrator_next_step(integrator) : statistics().last_step);
        advance(t, x);
    }
    TEST_ASSERT_LESS_OR_EQUAL_INT(failed + 5, statistics().failed_steps);
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
            double x[2];
            double reached;
            configure(1e-8);
            restart(INFINITY);
            statuses[k] = integrator_advance(integrator, lengths[i], step_limit, &reached, x);
            evaluations[k] = statistics().rhs_evaluations;
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

/* ---- Who watches internal steps ---------------------------------------------------------------
 */

/* Sees each of them once, changes none, and may end an advance. */

static const double tolerance = 1e-9;

enum { MOST_STEPS = 20000 };

static struct {
    unsigned count;
    unsigned end_at; /* the step after which it ends the advance, counted from 1; 0: none */
    double times[MOST_STEPS];
    double largest_error;
} seen;

static bool watch(void *context, double t, const double x[]) {
    TEST_ASSERT_EQUAL_PTR(&seen, context);
    TEST_ASSERT_TRUE(seen.count < MOST_STEPS);
    seen.times[seen.count++] = t;
    seen.largest_error = fmax(seen.largest_error, fmax(fabs(x[0] - cos(t)), fabs(x[1] + sin(t))));
    return seen.count == seen.end_at;
}

/* All methods need many internal steps for an advance of some seconds. */
static const double some_step = 0.25;

static void begin(const struct integrator_start *from, double max_step) {
    tearDown();
    circle.failing_from = INFINITY;
    create(1);
    configure_integrator(integrator, method, tolerance, max_step);
    ASSERT_OK(integrator_restart(integrator, start, from));
}

static void begin_again(void) {
    begin(&(struct integrator_start){.horizon = INFINITY}, some_step);
}

static void watch_from(unsigned end_at) {
    memset(&seen, 0, sizeof seen);
    seen.end_at = end_at;
    integrator_set_observer(integrator, watch, &seen);
}

static enum status advance_to(double t, int64_t steps, double *reached, double x[2]) {
    return integrator_advance(integrator, t, steps, reached, x);
}

static const double stops[] = {0.1, 0.100001, 2.0, 2.5, 9.0};
enum { STOPS = 5 };

EACH_METHOD static void test_each_step_is_seen_once(void) {
    double x[2];
    double reached;
    begin_again();
    watch_from(0);
    for (int i = 0; i < STOPS; i++) {
        const unsigned before = seen.count;
        ASSERT_OK(advance_to(stops[i], 100000, &reached, x));
        for (unsigned k = before; k < seen.count; k++) {
            TEST_ASSERT_TRUE(seen.times[k] < stops[i]);
        }
    }
    for (unsigned k = 1; k < seen.count; k++) {
        TEST_ASSERT_TRUE(seen.times[k] > seen.times[k - 1]);
    }
    TEST_ASSERT_TRUE(seen.largest_error < 1e3 * tolerance);

    // all but those that end at a stop, or beyond the last one
    TEST_ASSERT_TRUE(seen.count < statistics().steps);
    TEST_ASSERT_TRUE(seen.count + STOPS >= statistics().steps);
}

EACH_METHOD static void test_watching_changes_nothing_nor_the_limit_of_steps(void) {
    double x[2][STOPS + 1][2];
    double reached[2];
    struct integrator_statistics counts[2];
    memset(counts, 0, sizeof counts);
    for (int i = 0; i < 4; i++) {
        const int watched = i / 2;
        begin_again();
        if (watched) {
            watch_from(0);
        }
        for (int k = 0; k < STOPS && i % 2 == 0; k++) {
            ASSERT_OK(advance_to(stops[k], 100000, &reached[watched], x[watched][k]));
        }
        if (i % 2 == 0) {
            counts[watched] = statistics();
        } else {
            TEST_ASSERT_EQUAL_INT(STATUS_TOO_MANY_STEPS,
                                  advance_to(9.0, 12, &reached[watched], x[watched][STOPS]));
        }
    }
    TEST_ASSERT_EQUAL_MEMORY(x[0], x[1], sizeof x[0]);
    TEST_ASSERT_TRUE(counts[0].steps == counts[1].steps);
    TEST_ASSERT_TRUE(counts[0].rhs_evaluations <= counts[1].rhs_evaluations);
    TEST_ASSERT_TRUE(counts[0].last_step == counts[1].last_step);
    TEST_ASSERT_TRUE(reached[0] == reached[1]);
    TEST_ASSERT_EQUAL_UINT(12, seen.count);
}

EACH_METHOD static void test_an_advance_ends_where_the_watcher_says(void) {
    double x[2];
    double reached;
    begin_again();
    watch_from(7);
    ASSERT_OK(advance_to(9.0, 100000, &reached, x));
    TEST_ASSERT_EQUAL_UINT(7, seen.count);
    TEST_ASSERT_TRUE(reached == seen.times[6]);
    TEST_ASSERT_DOUBLE_WITHIN(1e3 * tolerance, cos(reached), x[0]);
    TEST_ASSERT_EQUAL_INT(0, message_count);
    TEST_ASSERT_TRUE(statistics().steps == 7);

    integrator_set_observer(integrator, NULL, NULL);
    ASSERT_OK(advance_to(9.0, 100000, &reached, x));
    TEST_ASSERT_TRUE(reached == 9.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e4 * tolerance, cos(9.0), x[0]);
    TEST_ASSERT_EQUAL_UINT(7, seen.count);
}

/* The Taylor method sees it where an internal step begins. An integrator that gives up begins again
 * with shorter steps: no time is seen twice. Also then the watcher may end the advance, which does
 * not fail. */
EACH_METHOD static void test_times_rise_where_the_right_hand_side_fails(void) {
    double x[2];
    double reached;
    begin_again();
    circle.failing_from = 2.0;
    watch_from(0);
    TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE, advance_to(9.0, 1000, &reached, x));
    TEST_ASSERT_TRUE(reached > 1.5 && reached <= 2.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e3 * tolerance, cos(reached), x[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e3 * tolerance, -sin(reached), x[1]);
    TEST_ASSERT_GREATER_THAN_UINT(5, seen.count);
    for (unsigned k = 1; k < seen.count; k++) {
        TEST_ASSERT_TRUE(seen.times[k] > seen.times[k - 1]);
    }
    TEST_ASSERT_TRUE(seen.times[seen.count - 1] <= reached);
    const unsigned all = seen.count;
    begin_again();
    circle.failing_from = 2.0;
    watch_from(all);
    ASSERT_OK(advance_to(9.0, 1000, &reached, x));
    TEST_ASSERT_TRUE(reached == seen.times[all - 1]);
    TEST_ASSERT_DOUBLE_WITHIN(1e3 * tolerance, cos(reached), x[0]);
}

EACH_METHOD static void test_only_a_point_that_was_passed_is_interpolated(void) {
    const struct integrator_start on = {.horizon = INFINITY, .continues = true};
    double x[2] = {-7.0, -7.0};
    double expected[2];
    double reached;
    begin(&on, 0.0);
    TEST_ASSERT_FALSE(integrator_interpolate(integrator, 0.5, x));
    TEST_ASSERT_TRUE(x[0] == -7.0);
    ASSERT_OK(advance_to(1.0, 100000, &reached, x));
    const double next = 1.0 + 1e-6;
    if (!(integrator_longest_history((enum integrator_method)method, false) > 0)) {
        TEST_ASSERT_FALSE(integrator_interpolate(integrator, next, x));
        return;
    }
    TEST_ASSERT_TRUE(integrator_interpolate(integrator, next, x));
    begin(&on, 0.0);
    ASSERT_OK(advance_to(1.0, 100000, &reached, expected));
    ASSERT_OK(advance_to(next, 100000, &reached, expected));
    TEST_ASSERT_EQUAL_MEMORY(expected, x, sizeof x);
    TEST_ASSERT_FALSE(integrator_interpolate(integrator, 100.0, x));
}

/* The circle falls towards the level of an indicator and turns, just above it or as low as a touch.
 * With taylor steps are longer where events are searched. */
EACH_METHOD static void test_an_event_that_does_not_come_changes_no_bit(void) {
    const bool is_erk = method == INTEGRATOR_ERK;
    begin_again();
    configure_integrator(integrator, method, is_erk ? 1e-3 : 1e-10, 0.0);
    for (int i = 0; i < 480 && method != INTEGRATOR_TAYLOR; i++) {
        const double distance = pow(10.0, -3 - i % 12) * (is_erk && i % 24 > 14 ? -1.0 : 1.0);
        const double before = pow((8.8 + 0.05 * i) * fabs(distance), 0.25); // s, from the turn
        const double from[2] = {-cos(before), -sin(before)};
        const struct indicator indicator = {
            .kind = INDICATOR_OF_STATE, .factor = 1.0, .offset = 1.0 + distance};
        struct integrator_start on = {.horizon = INFINITY, .first_step = 1.0};
        double x[2][3][2];
        for (int watched = 0; watched < 2; watched++) {
            ASSERT_OK(integrator_restart(integrator, from, &on));
            for (int k = 0; k < 3; k++) {
                double reached;
                ASSERT_OK(advance_to((1.0 + 0.5 * k) * before, 100000, &reached, x[watched][k]));
                TEST_ASSERT_NULL(integrator_event(integrator));
            }
            on.indicators = &indicator;
        }
        TEST_ASSERT_EQUAL_MEMORY(x[0], x[1], sizeof x[0]);
    }
}
