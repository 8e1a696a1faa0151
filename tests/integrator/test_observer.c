/* Who watches the internal steps of an integrator sees each of them once, changes none, and may end
 * an advance. */
#include "each_method.h"
#include "integrator_test.h"

static struct circle circle;
static struct integrator *integrator;
static unsigned message_count;

static void count_message(void *context, enum status status, const char *text) {
    message_count += text[0] != '\0';
}

static const double tolerance = 1e-9;
static const double start[2] = {1.0, 0.0};

static void begin(const struct integrator_start *start_of, double max_step) {
    const struct ode ode = {.state_count = 2,
                            .rhs = circle_rhs,
                            .jacobian = circle_jacobian,
                            .series = circle_series,
                            .series_row_count = 2,
                            .indicator_count = 1,
                            .context = &circle};
    const struct message_sink sink = {.write = count_message};
    circle = (struct circle){.failing_from = INFINITY};
    message_count = 0;
    ASSERT_OK(integrator_create(&ode, &sink, &integrator));
    configure_integrator(integrator, method, tolerance, max_step);
    ASSERT_OK(integrator_restart(integrator, start, start_of));
}

/* All methods need many internal steps for an advance of some seconds. */
void setUp(void) {
    begin(&(struct integrator_start){.horizon = INFINITY}, 0.25);
}

void tearDown(void) {
    integrator_destroy(integrator);
}

static void begin_again(void) {
    tearDown();
    setUp();
}

/* ---- A watcher ------------------------------------------------------------------------------ */

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

static void begin_watching(unsigned end_at) {
    memset(&seen, 0, sizeof seen);
    seen.end_at = end_at;
    integrator_set_observer(integrator, watch, &seen);
}

static enum status advance(double t, int64_t steps, double *reached, double x[2]) {
    return integrator_advance(integrator, t, steps, reached, x);
}

/* ---- Tests ---------------------------------------------------------------------------------- */

static const double stops[] = {0.1, 0.100001, 2.0, 2.5, 9.0};
enum { STOPS = 5 };

EACH_METHOD static void test_each_step_is_seen_once(void) {
    double x[2];
    double reached;
    begin_watching(0);
    for (int i = 0; i < STOPS; i++) {
        const unsigned before = seen.count;
        ASSERT_OK(advance(stops[i], 100000, &reached, x));
        for (unsigned k = before; k < seen.count; k++) {
            TEST_ASSERT_TRUE(seen.times[k] < stops[i]);
        }
    }
    for (unsigned k = 1; k < seen.count; k++) {
        TEST_ASSERT_TRUE(seen.times[k] > seen.times[k - 1]);
    }
    TEST_ASSERT_TRUE(seen.largest_error < 1e3 * tolerance);

    // all but those that end at a stop, or beyond the last one
    struct integrator_statistics statistics;
    integrator_get_statistics(integrator, &statistics);
    TEST_ASSERT_TRUE(seen.count < statistics.steps);
    TEST_ASSERT_TRUE(seen.count + STOPS >= statistics.steps);
}

EACH_METHOD static void test_watching_changes_nothing_nor_the_limit_of_steps(void) {
    double x[2][STOPS + 1][2];
    double reached[2];
    struct integrator_statistics statistics[2];
    memset(statistics, 0, sizeof statistics);
    for (int i = 0; i < 4; i++) {
        const int watched = i / 2;
        begin_again();
        if (watched) {
            begin_watching(0);
        }
        for (int k = 0; k < STOPS && i % 2 == 0; k++) {
            ASSERT_OK(advance(stops[k], 100000, &reached[watched], x[watched][k]));
        }
        if (i % 2 == 0) {
            integrator_get_statistics(integrator, &statistics[watched]);
        } else {
            TEST_ASSERT_EQUAL_INT(STATUS_TOO_MANY_STEPS,
                                  advance(9.0, 12, &reached[watched], x[watched][STOPS]));
        }
    }
    TEST_ASSERT_EQUAL_MEMORY(x[0], x[1], sizeof x[0]);
    TEST_ASSERT_TRUE(statistics[0].steps == statistics[1].steps);
    TEST_ASSERT_TRUE(statistics[0].rhs_evaluations <= statistics[1].rhs_evaluations);
    TEST_ASSERT_TRUE(statistics[0].last_step == statistics[1].last_step);
    TEST_ASSERT_TRUE(reached[0] == reached[1]);
    TEST_ASSERT_EQUAL_UINT(12, seen.count);
}

EACH_METHOD static void test_an_advance_ends_where_the_watcher_says(void) {
    double x[2];
    double reached;
    begin_watching(7);
    ASSERT_OK(advance(9.0, 100000, &reached, x));
    TEST_ASSERT_EQUAL_UINT(7, seen.count);
    TEST_ASSERT_TRUE(reached == seen.times[6]);
    TEST_ASSERT_DOUBLE_WITHIN(1e3 * tolerance, cos(reached), x[0]);
    TEST_ASSERT_EQUAL_UINT(0, message_count);
    struct integrator_statistics statistics;
    integrator_get_statistics(integrator, &statistics);
    TEST_ASSERT_TRUE(statistics.steps == 7);

    integrator_set_observer(integrator, NULL, NULL);
    ASSERT_OK(advance(9.0, 100000, &reached, x));
    TEST_ASSERT_TRUE(reached == 9.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e4 * tolerance, cos(9.0), x[0]);
    TEST_ASSERT_EQUAL_UINT(7, seen.count);
}

/* An integrator that gives up begins again with shorter steps: no time is seen twice. Also then the
 * watcher may end the advance, which does not fail. */
EACH_METHOD static void test_times_rise_where_the_right_hand_side_fails(void) {
    double x[2];
    double reached;
    circle.failing_from = 2.0;
    begin_watching(0);
    TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE, advance(9.0, 1000, &reached, x));
    TEST_ASSERT_TRUE(reached <= 2.0);
    TEST_ASSERT_GREATER_THAN_UINT(5, seen.count);
    for (unsigned k = 1; k < seen.count; k++) {
        TEST_ASSERT_TRUE(seen.times[k] > seen.times[k - 1]);
    }
    TEST_ASSERT_TRUE(seen.times[seen.count - 1] <= reached);
    const unsigned all = seen.count;
    begin_again();
    circle.failing_from = 2.0;
    begin_watching(all);
    ASSERT_OK(advance(9.0, 1000, &reached, x));
    TEST_ASSERT_TRUE(reached == seen.times[all - 1]);
    TEST_ASSERT_DOUBLE_WITHIN(1e3 * tolerance, cos(reached), x[0]);
}

/* ---- Points that were passed ------------------------------------------------------------------
 */

EACH_METHOD static void test_only_a_point_that_was_passed_is_interpolated(void) {
    const struct integrator_start on = {.horizon = INFINITY, .continues = true};
    double x[2] = {-7.0, -7.0};
    double expected[2];
    double reached;
    tearDown();
    begin(&on, 0.0);
    TEST_ASSERT_FALSE(integrator_interpolate(integrator, 0.5, x));
    TEST_ASSERT_TRUE(x[0] == -7.0);
    ASSERT_OK(advance(1.0, 100000, &reached, x));
    const double next = 1.0 + 1e-6;
    if (!(integrator_longest_history((enum integrator_method)method, false) > 0)) {
        TEST_ASSERT_FALSE(integrator_interpolate(integrator, next, x));
        return;
    }
    TEST_ASSERT_TRUE(integrator_interpolate(integrator, next, x));
    tearDown();
    begin(&on, 0.0);
    ASSERT_OK(advance(1.0, 100000, &reached, expected));
    ASSERT_OK(advance(next, 100000, &reached, expected));
    TEST_ASSERT_EQUAL_MEMORY(expected, x, sizeof x);
    TEST_ASSERT_FALSE(integrator_interpolate(integrator, 100.0, x));
}

/* ---- Events that do not come ---------------------------------------------------------------- */

/* The circle falls towards the level of an indicator and turns, just above it or as low as a touch.
 * With taylor steps are longer where events are searched. */
EACH_METHOD static void test_an_event_that_does_not_come_changes_no_bit(void) {
    const bool is_erk = method == INTEGRATOR_ERK;
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
                ASSERT_OK(advance((1.0 + 0.5 * k) * before, 100000, &reached, x[watched][k]));
                TEST_ASSERT_NULL(integrator_event(integrator));
            }
            on.indicators = &indicator;
        }
        TEST_ASSERT_EQUAL_MEMORY(x[0], x[1], sizeof x[0]);
    }
}
