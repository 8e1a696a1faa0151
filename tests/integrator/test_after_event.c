/* Steps after an event: the next one may be near. */
#include "integrator_test.h"

#include <unity.h>

static struct integrator *integrator;

void setUp(void) {
    integrator = NULL;
}

void tearDown(void) {
    integrator_destroy(integrator);
}

static const double g = 9.81; /* m/s2 */
static const double w = 30.0; /* of the spring, rad/s */

/* x'' = -g - w^2 x + jerk t. */
static double jerk;
static bool has_spring;
static const double tolerance = 1e-9;
static const int methods[] = {INTEGRATOR_CVODE_ADAMS, INTEGRATOR_TAYLOR};

static double stiffness(void) {
    return has_spring ? w * w : 0.0;
}

static enum status rhs(double t, const double x[], double dx[], void *context) {
    dx[0] = x[1];
    dx[1] = -g - stiffness() * x[0] + jerk * t;
    return STATUS_OK;
}

static enum status jacobian(double t, const double x[], double J[], void *context) {
    const double columns[4] = {0.0, -stiffness(), 1.0, 0.0};
    memcpy(J, columns, sizeof columns);
    return STATUS_OK;
}

static enum status series(double t, double time_scale, int first, int last,
                          double row[][SERIES_LENGTH], void *context) {
    for (int k = first > 0 ? first : 1; k <= last; k++) {
        const double force = k == 1 ? -g + jerk * t : k == 2 ? jerk * time_scale : 0.0;
        row[0][k] = time_scale / k * row[1][k - 1];
        row[1][k] = time_scale / k * (force - stiffness() * row[0][k - 1]);
    }
    return STATUS_OK;
}

/* Goes on after an event from x and v to the next fall of x, or to 1 s; the time there. */
static double fall_after_event(int method, double x, double v, double before, bool has_series) {
    static const struct indicator indicator = {
        .kind = INDICATOR_OF_STATE, .factor = 1.0, .rises = true};
    const struct message_sink quiet = {0};
    const struct ode ode = {.state_count = 2,
                            .rhs = rhs,
                            .jacobian = jacobian,
                            .series = has_series ? series : NULL,
                            .series_row_count = 2,
                            .indicator_count = 1};
    const struct integrator_start start = {.horizon = INFINITY,
                                           .first_step = before,
                                           .continues = true,
                                           .is_after_event = true,
                                           .indicators = &indicator};
    double state[2] = {x, v};
    double reached = 0.0;
    ASSERT_OK(integrator_create(&ode, &quiet, &integrator));
    configure_integrator(integrator, method, tolerance, 0.0);
    ASSERT_OK(integrator_restart(integrator, state, &start));
    ASSERT_OK(integrator_advance(integrator, 1.0, 1000, &reached, state));
    return reached;
}

static struct integrator_statistics destroyed(void) {
    const struct integrator_statistics totals = *integrator_totals(integrator);
    integrator_destroy(integrator);
    integrator = NULL;
    return totals;
}

/* Flights from 5 mm to 5e-21 m: x = v / w sin wt - g / w^2 (1 - cos wt) falls at 2 / w atan(v w /
 * g).
 */
static void test_a_flight_is_few_steps_of_low_order(void) {
    jerk = 0.0;
    has_spring = true;
    for (int i = 0; i < 2; i++) {
        double before = 0.05;
        for (double v = 0.3; v > 3e-10; v *= 0.5) {
            const double expected = 2.0 / w * atan(v * w / g);
            const double found = fall_after_event(methods[i], 0.0, v, before, true);
            const struct integrator_statistics totals = destroyed();
            TEST_ASSERT_DOUBLE_WITHIN(1e-6 * expected, expected, found);
            TEST_ASSERT_LESS_OR_EQUAL_INT(v > 1e-3 ? 30 : 2, totals.steps);
            TEST_ASSERT_LESS_OR_EQUAL_INT(v > 1e-3 ? 19 : 5, totals.last_order);
            before = found;
        }
    }
}

/* Also where all terms but few are 0. */
static void test_flights_without_a_spring_are_parabolas(void) {
    jerk = 0.0;
    has_spring = false;
    for (int i = 0; i < 2; i++) {
        for (double v = 1e-2; v > 1e-12; v *= 0.25) {
            const double expected = 2.0 * v / g;
            const double found = fall_after_event(methods[i], 0.0, v, expected, true);
            (void)destroyed();
            TEST_ASSERT_DOUBLE_WITHIN(1e-9 * expected, expected, found);
        }
    }
}

/* x = 1 - t - g / 2 t^2 + 20 t^3 does not fall, though its parabola does. */
static void test_a_wrong_guess_takes_one_more_step(void) {
    jerk = 120.0;
    has_spring = false;
    TEST_ASSERT_TRUE(fall_after_event(INTEGRATOR_TAYLOR, 1.0, -1.0, 0.5, true) == 1.0);
    TEST_ASSERT_EQUAL_INT(2, destroyed().steps);
    TEST_ASSERT_TRUE(fall_after_event(INTEGRATOR_CVODE_ADAMS, 1.0, -1.0, 0.5, true) == 1.0);
    jerk = 0.0;
}
