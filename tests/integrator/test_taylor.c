/* Steps by Taylor series: which orders they take, how long they are, and where they end; events,
 * whose indicators are rows of the series, and states that may move only so far within a step. */
#include "integrator_test.h"

/* ---- Equations ------------------------------------------------------------------------------ */

/* x1' = x2, x2' = rate x1 + (t / s)^3 */
static double rate;

static enum status linear_rhs(double t, const double x[], double dx[], void *context) {
    dx[0] = x[1];
    dx[1] = rate * x[0] + t * t * t;
    return STATUS_OK;
}

static enum status linear_series(double t, double time_scale, int first, int last,
                                 double row[][SERIES_LENGTH], void *context) {
    // (t + s time_scale)^3
    const double push[4] = {t * t * t, 3.0 * t * t * time_scale, 3.0 * t * time_scale * time_scale,
                            time_scale * time_scale * time_scale};
    for (int k = first > 0 ? first : 1; k <= last; k++) {
        row[0][k] = time_scale / k * row[1][k - 1];
        row[1][k] = time_scale / k * (rate * row[0][k - 1] + (k <= 4 ? push[k - 1] : 0.0));
    }
    return STATUS_OK;
}

/* x1' = x1^2, x2' = 0 */
static enum status square_rhs(double t, const double x[], double dx[], void *context) {
    dx[0] = x[0] * x[0];
    dx[1] = 0.0;
    return STATUS_OK;
}

static enum status square_series(double t, double time_scale, int first, int last,
                                 double row[][SERIES_LENGTH], void *context) {
    for (int k = first > 0 ? first : 1; k <= last; k++) {
        double sum = 0.0;
        for (int i = 0; i < k; i++) {
            sum += row[0][i] * row[0][k - 1 - i];
        }
        row[0][k] = time_scale / k * sum;
        row[1][k] = 0.0;
    }
    return STATUS_OK;
}

/* x1' = a pulse of area 1, x2' = 0 */
static double place, width;

static enum status pulse_rhs(double t, const double x[], double dx[], void *context) {
    const double z = (t - place) / width;
    dx[0] = exp(-0.5 * z * z) / (width * sqrt(6.283185307179586));
    dx[1] = 0.0;
    return STATUS_OK;
}

/* Rows behind the states: the argument of the exponential function, and its value. */
static enum status pulse_series(double t, double time_scale, int first, int last,
                                double row[][SERIES_LENGTH], void *context) {
    const double z = (t - place) / width;
    const double dz = time_scale / width;
    for (int k = first; k <= last; k++) {
        row[2][k] = k == 0 ? -0.5 * z * z : k == 1 ? -z * dz : k == 2 ? -0.5 * dz * dz : 0.0;
        row[3][k] = k == 0 ? exp(row[2][0]) : 0.0;
        for (int i = 1; i <= k; i++) {
            row[3][k] += i * row[2][i] * row[3][k - i] / k;
        }
        if (k > 0) {
            row[0][k] = dz / k * row[3][k - 1] / sqrt(6.283185307179586);
            row[1][k] = 0.0;
        }
    }
    return STATUS_OK;
}

static const struct series_inner exponential = {3 * SERIES_LENGTH, 2 * SERIES_LENGTH};
static const struct series pulse_rows = {
    .row_count = 4, .inner = &exponential, .inner_count = 1, .inner_stride = 1};

/* ---- Runs ----------------------------------------------------------------------------------- */

static struct integrator *integrator;
static const double usual_tolerance = 1e-10;

static void create_at(ode_rhs *rhs, ode_series *series, double max_step, double tolerance) {
    const bool is_pulse = series == pulse_series;
    const struct ode ode = {.state_count = 2,
                            .rhs = rhs,
                            .series = series,
                            .series_row_count = is_pulse ? 4 : 2,
                            .rows = is_pulse ? &pulse_rows : NULL};
    const struct message_sink quiet = {0};
    integrator_destroy(integrator);
    ASSERT_OK(integrator_create(&ode, &quiet, &integrator));
    configure_integrator(integrator, INTEGRATOR_TAYLOR, tolerance, max_step);
}

static void create(ode_rhs *rhs, ode_series *series, double max_step) {
    create_at(rhs, series, max_step, usual_tolerance);
}

static void restart(double x1, double x2, double horizon, bool continues) {
    const struct integrator_start start = {.horizon = horizon, .continues = continues};
    const double x[2] = {x1, x2};
    ASSERT_OK(integrator_restart(integrator, x, &start));
}

static void advance(double t, double x[2]) {
    double reached;
    ASSERT_OK(integrator_advance(integrator, t, 1000, &reached, x));
    TEST_ASSERT_TRUE(reached == t);
}

static struct integrator_statistics statistics(void) {
    return *integrator_totals(integrator);
}

void setUp(void) {
    integrator = NULL;
    rate = -1.0;
    create(linear_rhs, linear_series, 0.0);
}

void tearDown(void) {
    integrator_destroy(integrator);
}

/* x1 of rate = -1 from rest at 1: cos t + t^3 - 6 t + 6 sin t */
static double driven_circle(double t) {
    return cos(t) + t * t * t - 6.0 * t + 6.0 * sin(t);
}

/* ---- Orders --------------------------------------------------------------------------------- */

/* Its first terms that are not 0 are of the orders 4 and 5. */
static void test_an_input_that_begins_as_a_cube_is_not_overlooked(void) {
    double x[2];
    rate = 0.0;
    restart(0.0, 0.0, INFINITY, false);
    advance(1.0, x);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0.05, x[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0.25, x[1]);
}

/* Near an equilibrium that repels, terms are within the usual_tolerance, grow, and decrease only
 * later.
 */
static void test_terms_that_grow_are_not_taken_for_small_ones(void) {
    static const double from_rest[] = {1e-30, 1e-20, 1e-14, 1e-12};
    for (size_t i = 0; i < sizeof from_rest / sizeof from_rest[0]; i++) {
        double x[2];
        const double r = 12.0;
        rate = r * r;
        restart(from_rest[i], r * from_rest[i], INFINITY, false);
        advance(0.25, x);
        // the push (t / s)^3 in closed form: particular solution with zero start
        const double t = 0.25;
        const double pushed =
            6.0 / pow(r, 5) * sinh(r * t) - t * t * t / (r * r) - 6.0 * t / pow(r, 4);
        const double exact = from_rest[i] * exp(r * t) + pushed;
        TEST_ASSERT_DOUBLE_WITHIN(4.0 * usual_tolerance * (fabs(exact) + 1e-2) * exp(r * t), exact,
                                  x[0]);
    }
}

static void test_more_exact_results_take_more_orders(void) {
    double x[2];
    restart(1.0, 0.0, INFINITY, false);
    advance(1e-6, x);
    const int fewest = statistics().last_order;
    restart(1.0, 0.0, INFINITY, false);
    advance(0.5, x);
    TEST_ASSERT_EQUAL_INT(5, fewest);
    TEST_ASSERT_GREATER_THAN_INT(8, statistics().last_order);
    TEST_ASSERT_TRUE(statistics().steps == 2 && statistics().rhs_evaluations == 4);
    TEST_ASSERT_DOUBLE_WITHIN(usual_tolerance, driven_circle(0.5), x[0]);
}

/* Where the tolerance is smaller, series are longer, and steps not much shorter. */
static void test_a_smaller_tolerance_takes_few_more_steps(void) {
    static const double tolerances[] = {1e-4, 1e-12};
    int64_t steps[2];
    for (size_t i = 0; i < 2; i++) {
        double x[2];
        create_at(linear_rhs, linear_series, 0.0, tolerances[i]);
        restart(1.0, 0.0, INFINITY, false);
        advance(100.0, x);
        steps[i] = statistics().steps;
    }
    TEST_ASSERT_TRUE(2 * steps[1] <= 3 * steps[0]);
}

/* ---- Steps ---------------------------------------------------------------------------------- */

static void test_after_a_change_a_step_ends_where_it_is_asked_to(void) {
    double x[2];
    restart(1.0, 0.0, INFINITY, false);
    advance(0.125, x);
    TEST_ASSERT_TRUE(integrator_passed_time(integrator) == 0.125);
    TEST_ASSERT_FALSE(integrator_interpolate(integrator, 0.25, x));
}

static void test_along_a_solution_a_step_goes_past_the_points(void) {
    double many[100][2];
    double alone[2];
    restart(1.0, 0.0, INFINITY, true);
    for (int i = 0; i < 100; i++) {
        advance(1e-3 * (i + 1), many[i]);
        TEST_ASSERT_DOUBLE_WITHIN(usual_tolerance, driven_circle(1e-3 * (i + 1)), many[i][0]);
    }
    TEST_ASSERT_TRUE(statistics().steps == 1);
    TEST_ASSERT_TRUE(integrator_passed_time(integrator) > 0.5);

    // each of them lies where it would without the others
    for (int i = 1; i < 100; i++) {
        restart(1.0, 0.0, INFINITY, true);
        advance(1e-3, alone);
        advance(1e-3 * (i + 1), alone);
        TEST_ASSERT_EQUAL_MEMORY(many[i], alone, sizeof alone);
    }
}

static void test_a_step_along_a_solution_has_its_limits(void) {
    double x[2];
    restart(1.0, 0.0, 0.25, true);
    advance(0.125, x);
    TEST_ASSERT_TRUE(integrator_passed_time(integrator) == 0.25);
    create(linear_rhs, linear_series, 0.375);
    restart(1.0, 0.0, INFINITY, true);
    advance(0.125, x);
    TEST_ASSERT_TRUE(integrator_passed_time(integrator) == 0.375);
    TEST_ASSERT_TRUE(statistics().last_step == 0.375);

    // only the first step is long: the next one ends where the advance does
    restart(1.0, 0.0, INFINITY, true);
    advance(0.5, x);
    TEST_ASSERT_TRUE(integrator_passed_time(integrator) == 0.5);
}

static void test_the_longest_step_divides_an_advance_into_equal_parts(void) {
    double x[2];
    create(linear_rhs, linear_series, 0.001);
    restart(1.0, 0.0, INFINITY, false);
    advance(0.0105, x);
    TEST_ASSERT_TRUE(statistics().steps == 11);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0.0105 / 11.0, statistics().last_step);
    advance(0.0205, x);
    TEST_ASSERT_TRUE(statistics().steps == 21);
    TEST_ASSERT_DOUBLE_WITHIN(usual_tolerance, driven_circle(0.0205), x[0]);
}

static void test_no_tolerance_takes_more_orders_than_a_row_has(void) {
    double x[2];
    create_at(square_rhs, square_series, 0.0, 1e-40);
    restart(0.0, 0.0, INFINITY, true);
    advance(1e-3, x);
    TEST_ASSERT_EQUAL_INT(SERIES_LENGTH - 1, statistics().last_order);
}

/* ---- Within a step -------------------------------------------------------------------------- */

/* Returns the largest error of x1 at whole seconds, over places and widths from `narrowest`
 * on that do not repeat. */
static double error_over_pulses(double narrowest, double max_step, int count) {
    double largest = 0.0;
    create(pulse_rhs, pulse_series, max_step);
    for (int n = 0; n < count; n++) {
        double x[2];
        place = fmod(n * 1.8541019662496845, 3.0);
        width = narrowest * exp(fmod(n * 1.2451223338, 3.0));
        restart(0.0, 1.0, INFINITY, n % 2 == 0);
        for (int t = 1; t <= 3; t++) {
            const double per_width = 1.0 / (width * sqrt(2.0));
            advance(t, x);
            const double exact = erf((t - place) * per_width) + erf(place * per_width);
            largest = fmax(largest, fabs(x[0] - 0.5 * exact));
        }
    }
    return largest;
}

/* They last some 16 widths, and the points within have a distance of 1/32 s. */
static void test_no_step_hides_a_pulse_that_lasts_longer_than_a_part_of_it(void) {
    TEST_ASSERT_DOUBLE_WITHIN(10.0 * usual_tolerance, 0.0, error_over_pulses(2.5e-3, 0.0, 1000));
}

/* As src/README.md says: a narrower one needs a longest step. */
static void test_a_longest_step_finds_a_narrow_pulse(void) {
    TEST_ASSERT_TRUE(error_over_pulses(1e-4, 0.0, 20) > 0.1);
    TEST_ASSERT_DOUBLE_WITHIN(10.0 * usual_tolerance, 0.0, error_over_pulses(1e-4, 0.03, 20));
}

/* ---- Extremes ------------------------------------------------------------------------------- */

static void test_a_pole_is_not_passed(void) {
    double x[2];
    double reached;
    create(square_rhs, square_series, 0.0);
    restart(1.0, 0.0, INFINITY, false);
    TEST_ASSERT_TRUE(integrator_advance(integrator, 2.0, 10000, &reached, x) != STATUS_OK);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1.0, reached);
    TEST_ASSERT_TRUE(isfinite(x[0]) && x[0] > 1000.0);

    restart(1.0, 0.0, INFINITY, false);
    advance(0.999, x);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 1000.0, x[0]);
}

/* Terms of high order overflow where the time_scale is much longer than the motion is quick. */
static void test_a_unit_in_which_terms_overflow_is_shortened(void) {
    double x[2];
    double reached;
    rate = -1e30;
    restart(1.0, 0.0, INFINITY, false);
    TEST_ASSERT_EQUAL_INT(STATUS_TOO_MANY_STEPS,
                          integrator_advance(integrator, 1e8, 100, &reached, x));
    TEST_ASSERT_TRUE(reached > 1e-14 && reached < 1e-12);
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, cos(1e15 * reached), x[0]);
    TEST_ASSERT_TRUE(statistics().failed_steps > 0);
    TEST_ASSERT_TRUE(statistics().steps == 100);
    TEST_ASSERT_TRUE(statistics().last_step > 0.005 * reached); // it stays as long
}

static void test_values_that_overflow_at_once_are_refused(void) {
    double x[2];
    double reached;
    create(square_rhs, square_series, 0.0);
    restart(1e200, 0.0, INFINITY, false);
    TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE, integrator_advance(integrator, 1.0, 10, &reached, x));
    TEST_ASSERT_TRUE(reached == 0.0 && x[0] == 1e200);
}

static void test_shortest_steps_are_exact(void) {
    for (int decade = -300; decade < -20; decade += 20) {
        double x[2];
        const double t = pow(10.0, decade);
        restart(0.0, 1.0, INFINITY, true);
        advance(t, x);
        TEST_ASSERT_TRUE(x[0] == t && x[1] == 1.0);
        advance(1.5 * t, x);
        TEST_ASSERT_TRUE(x[0] == 1.5 * t);
    }
}

/* ---- Events --------------------------------------------------------------------------------- */

/* An oscillator x1' = x2, x2' = -x1 from x1 = 0, x2 = 1. */
static struct circle circle = {.failing_from = INFINITY};
static const size_t row_of_left[1] = {2};
static const struct series left_rows = {.row_count = 1, .row_of_indicator = row_of_left};
static int indicator_calls;

/* What is left of the energy that x1^2 may have. */
static enum status energy_left(double t, const double x[], double z[], void *context) {
    indicator_calls++;
    z[0] = 0.5 - x[0] * x[0];
    return STATUS_OK;
}

static enum status energy_series(double t, double time_scale, int first, int last,
                                 double row[][SERIES_LENGTH], void *context) {
    for (int k = first; k <= last; k++) {
        if (k > 0) {
            row[0][k] = time_scale / k * row[1][k - 1];
            row[1][k] = -time_scale / k * row[0][k - 1];
        }
        row[2][k] = k == 0 ? 0.5 : 0.0;
        for (int i = 0; i <= k; i++) {
            row[2][k] -= row[0][i] * row[0][k - i];
        }
    }
    return STATUS_OK;
}

static void short_reach(const double x[], double reach[], void *context) {
    reach[0] = INFINITY;
    reach[1] = 0.01;
}

static void begin_oscillator(ode_reach *reach, double max_step) {
    static const struct indicator of_model = {.kind = INDICATOR_OF_MODEL};
    const struct integrator_start from = {.horizon = INFINITY, .indicators = &of_model};
    const struct message_sink quiet = {0};
    const double x[2] = {0.0, 1.0};
    const struct ode ode = {
        .state_count = 2,
        .rhs = circle_rhs,
        .series = energy_series,
        .series_row_count = 3,
        .rows = &left_rows,
        .indicator_count = 1,
        .indicators = energy_left,
        .reach = reach,
        .context = &circle,
    };
    indicator_calls = 0;
    integrator_destroy(integrator);
    ASSERT_OK(integrator_create(&ode, &quiet, &integrator));
    configure_integrator(integrator, INTEGRATOR_TAYLOR, 1e-12, max_step);
    ASSERT_OK(integrator_restart(integrator, x, &from));
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
    begin_oscillator(NULL, max_step);
    TEST_ASSERT_TRUE(go_to(0.5) == 0.5);
    TEST_ASSERT_NULL(integrator_event(integrator));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, quarter_turn, go_to(2.0));
    TEST_ASSERT_TRUE(integrator_event(integrator)[0]);
    return indicator_calls - 2 - (int)statistics().steps;
}

static void test_a_row_is_the_indicator(void) {
    TEST_ASSERT_EQUAL_INT(0, calls_between(0.01));
}

/* x1^2 swings twice as fast as x1: where x1 has just converged, it has not. The event is as exact
 * as ever, and takes no samples. */
static void test_a_row_that_has_not_converged_still_shows_the_event(void) {
    TEST_ASSERT_LESS_THAN_INT(5, calls_between(0.0));
}

static void test_no_state_moves_farther_than_it_may(void) {
    begin_oscillator(short_reach, 0.0);
    double v = 1.0;
    for (int64_t steps = 0; integrator_event(integrator) == NULL; steps++) {
        double reached;
        double x[2];
        const enum status status = integrator_advance(integrator, 2.0, 1, &reached, x);
        TEST_ASSERT_TRUE(status == STATUS_TOO_MANY_STEPS || status == STATUS_OK);
        TEST_ASSERT_TRUE(fabs(x[1] - v) <= 0.01 * (1.0 + 1e-12));
        TEST_ASSERT_LESS_THAN_INT64(1000, steps);
        v = x[1];
    }
    TEST_ASSERT_TRUE(statistics().steps > 29 && statistics().steps < 60); // v falls by 0.29
}
