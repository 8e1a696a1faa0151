/* Steps by Taylor series in which orders are missing: x' = p t^(p-1) x^2 from x = 1 at t = 0, with
 * the solution 1 / (1 - t^p), which has the powers 0, p, 2 p, 3 p ... of time and none between. */
#include "integrator_test.h"

static int power;
static struct integrator *integrator;

static enum status rhs(double t, const double x[], double dx[], void *context) {
    dx[0] = power * pow(t, power - 1) * x[0] * x[0];
    return STATUS_OK;
}

/* Coefficient k of p (t + s time_scale)^(p-1). */
static double factor(double t, double time_scale, int k) {
    double value = power;
    for (int i = 0; i < k; i++) {
        value *= time_scale * (power - 1 - i) / (i + 1);
    }
    return k < power ? value * pow(t, power - 1 - k) : 0.0;
}

static double product(const double x[], const double y[], int k) {
    double sum = 0.0;
    for (int i = 0; i <= k; i++) {
        sum += x[i] * y[k - i];
    }
    return sum;
}

enum row { X, SQUARE, FACTOR, ROWS };

static enum status series(double t, double time_scale, int first, int last,
                          double row[][SERIES_LENGTH], void *context) {
    for (int k = first; k <= last; k++) {
        if (k > 0) {
            row[X][k] = time_scale / k * product(row[FACTOR], row[SQUARE], k - 1);
        }
        row[SQUARE][k] = product(row[X], row[X], k);
        row[FACTOR][k] = factor(t, time_scale, k);
    }
    return STATUS_OK;
}

void setUp(void) {
    const struct ode ode = {
        .state_count = 1, .rhs = rhs, .series = series, .series_row_count = ROWS};
    const struct message_sink quiet = {0};
    ASSERT_OK(integrator_create(&ode, &quiet, &integrator));
}

void tearDown(void) {
    integrator_destroy(integrator);
}

/* The same beside a small exponential function, whose terms stand where those of x are missing, and
 * the time itself, whose term is larger than all others. */
static enum status rhs_of_three(double t, const double x[], double dx[], void *context) {
    dx[1] = x[1];
    dx[2] = 1.0;
    return rhs(t, x, dx, context);
}

static enum status series_of_three(double t, double time_scale, int first, int last,
                                   double row[][SERIES_LENGTH], void *context) {
    static double own[ROWS][SERIES_LENGTH];
    for (int k = first; k <= last; k++) {
        if (k == 0) {
            own[X][0] = row[0][0];
        } else {
            row[1][k] = time_scale / k * row[1][k - 1];
            row[2][k] = k == 1 ? time_scale : 0.0;
        }
        (void)series(t, time_scale, k, k, own, context);
        row[0][k] = own[X][k];
    }
    return STATUS_OK;
}

static void test_orders_that_nearly_vanish(void) {
    const struct ode ode = {
        .state_count = 3, .rhs = rhs_of_three, .series = series_of_three, .series_row_count = 3};
    const struct message_sink quiet = {0};
    const struct integrator_start start = {.horizon = INFINITY};
    power = 5;
    integrator_destroy(integrator);
    ASSERT_OK(integrator_create(&ode, &quiet, &integrator));
    configure_integrator(integrator, INTEGRATOR_TAYLOR, 1e-10, 0.0);
    for (int k = 0; k < 15; k++) {
        const double small = 1e-15 * (double)(1 << 2 * k); // to 3e-7
        const double begin[3] = {1.0, small, 0.0};
        double reached;
        double x[3];
        ASSERT_OK(integrator_restart(integrator, begin, &start));
        ASSERT_OK(integrator_advance(integrator, 0.5, 1000, &reached, x));
        TEST_ASSERT_DOUBLE_WITHIN(4e-10, 1.0 / (1.0 - 0.03125), x[0]);
        TEST_ASSERT_DOUBLE_WITHIN(4e-10 * small + 4e-12, small * exp(0.5), x[1]);
    }
}

/* Steps towards the pole at 1; a start error grows with x^2. */
static void assert_solution(double tolerance, bool continues) {
    configure_integrator(integrator, INTEGRATOR_TAYLOR, tolerance, 0.0);
    for (int i = 1; i < 10; i++) {
        const double begin = 1.0;
        const double t = 0.1 * i;
        const double exact = 1.0 / (1.0 - pow(t, power));
        const struct integrator_start start = {.horizon = INFINITY, .continues = continues};
        double reached, x;
        ASSERT_OK(integrator_restart(integrator, &begin, &start));
        ASSERT_OK(integrator_advance(integrator, t, 1000, &reached, &x));
        TEST_ASSERT_DOUBLE_WITHIN(4.0 * tolerance * exact * exact, exact, x);
    }
}

/* The largest order, which the tolerance determines, is odd for some of them and even for others.
 */
static void test_every_second_order_is_missing(void) {
    power = 2;
    for (int k = 0; k < 35; k++) {
        const double tolerance = 1e-3 / (double)((int64_t)1 << k); // to 6e-14
        assert_solution(tolerance, false);
        assert_solution(tolerance, true);
    }
}

static void test_several_orders_in_turn_are_missing(void) {
    for (power = 3; power <= 9; power++) {
        for (int k = 0; k < 12; k++) {
            const double tolerance = 1e-3 / (double)((int64_t)1 << 3 * k); // to 1e-13
            assert_solution(tolerance, false);
            assert_solution(tolerance, true);
        }
    }
}
