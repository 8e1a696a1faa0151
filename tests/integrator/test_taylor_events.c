/* Steps by Taylor series with events: indicators that are rows of the series, and states that may
 * move only so far within a step. An oscillator x' = v, v' = -x from x = 0, v = 1. */
#include "integrator_test.h"

enum row { X, V, LEFT, ROWS };

static const size_t row_of_indicator[1] = {LEFT};
static const struct series rows = {.row_count = 1, .row_of_indicator = row_of_indicator};
static struct integrator *integrator;
static int indicator_calls;

void setUp(void) {
    integrator = NULL;
    indicator_calls = 0;
}

void tearDown(void) {
    integrator_destroy(integrator);
}

static enum status rhs(double t, const double x[], double dx[], void *context) {
    dx[0] = x[1];
    dx[1] = -x[0];
    return STATUS_OK;
}

/* What is left of the energy that x^2 may have. */
static enum status indicators(double t, const double x[], double z[], void *context) {
    indicator_calls++;
    z[0] = 0.5 - x[0] * x[0];
    return STATUS_OK;
}

static enum status series(double t, double time_scale, int first, int last,
                          double row[][SERIES_LENGTH], void *context) {
    for (int k = first; k <= last; k++) {
        if (k > 0) {
            row[X][k] = time_scale / k * row[V][k - 1];
            row[V][k] = -time_scale / k * row[X][k - 1];
        }
        row[LEFT][k] = k == 0 ? 0.5 : 0.0;
        for (int i = 0; i <= k; i++) {
            row[LEFT][k] -= row[X][i] * row[X][k - i];
        }
    }
    return STATUS_OK;
}

static void short_reach(const double x[], double reach[], void *context) {
    reach[0] = INFINITY;
    reach[1] = 0.01;
}

static void start(const struct ode *ode, double max_step) {
    static const struct indicator of_model = {.kind = INDICATOR_OF_MODEL};
    const struct integrator_start from = {.horizon = INFINITY, .indicators = &of_model};
    const struct message_sink quiet = {0};
    const double x[2] = {0.0, 1.0};
    ASSERT_OK(integrator_create(ode, &quiet, &integrator));
    configure_integrator(integrator, INTEGRATOR_TAYLOR, 1e-12, max_step);
    ASSERT_OK(integrator_restart(integrator, x, &from));
}

static struct ode oscillator(void) {
    return (struct ode){
        .state_count = 2,
        .rhs = rhs,
        .series = series,
        .series_row_count = ROWS,
        .indicator_count = 1,
        .indicators = indicators,
    };
}

/* To the time t, or to the event where x^2 is 1/2, at pi / 4. */
static double go_to(double t) {
    double reached;
    double x[2];
    ASSERT_OK(integrator_advance(integrator, t, 1000, &reached, x));
    TEST_ASSERT_DOUBLE_WITHIN(1e-11, sin(reached), x[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-11, cos(reached), x[1]);
    return reached;
}

static const double quarter_turn = 0.78539816339744831; // pi / 4

/* Calls of the indicators on the way to the event, without those at the restart, at the ends of
 * steps and at the event. */
static int calls_between(double max_step) {
    struct ode ode = oscillator();
    struct integrator_statistics statistics;
    ode.rows = &rows;
    start(&ode, max_step);
    TEST_ASSERT_TRUE(go_to(0.5) == 0.5);
    TEST_ASSERT_NULL(integrator_event(integrator));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, quarter_turn, go_to(2.0));
    TEST_ASSERT_TRUE(integrator_event(integrator)[0]);
    integrator_get_statistics(integrator, &statistics);
    return indicator_calls - 2 - (int)statistics.steps;
}

static void test_a_row_is_the_indicator(void) {
    TEST_ASSERT_EQUAL_INT(0, calls_between(0.01));
}

/* x^2 swings twice as fast as x: where x has just converged, it has not. The event is as exact as
 * ever, and takes no samples. */
static void test_a_row_that_has_not_converged_still_shows_the_event(void) {
    TEST_ASSERT_LESS_THAN_INT(5, calls_between(0.0));
}

static void test_no_state_moves_farther_than_it_may(void) {
    struct ode ode = oscillator();
    ode.rows = &rows;
    ode.reach = short_reach;
    start(&ode, 0.0);
    double v = 1.0;
    struct integrator_statistics statistics;
    for (int64_t steps = 0; integrator_event(integrator) == NULL; steps++) {
        double reached;
        double x[2];
        const enum status status = integrator_advance(integrator, 2.0, 1, &reached, x);
        TEST_ASSERT_TRUE(status == STATUS_TOO_MANY_STEPS || status == STATUS_OK);
        TEST_ASSERT_TRUE(fabs(x[1] - v) <= 0.01 * (1.0 + 1e-12));
        TEST_ASSERT_LESS_THAN_INT64(1000, steps);
        v = x[1];
    }
    integrator_get_statistics(integrator, &statistics);
    TEST_ASSERT_TRUE(statistics.steps > 29 && statistics.steps < 60); // v falls by 0.29
}
