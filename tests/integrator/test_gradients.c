/* States with their gradients, as models with [gradients] have them: x' = -a x^3 and y' = -b y,
 * stiff, and behind them their derivatives by a, by b and by the start of x. */
#include "integrator_test.h"

enum { STATES = 2, GRADIENTS = 3, ALL = STATES * (1 + GRADIENTS) };

static const double a = 0.7;
static const double b = 1000.0;
static int jacobian_count;

static enum status rhs(double t, const double x[], double dx[], void *context) {
    for (int j = 0; j <= GRADIENTS; j++) {
        dx[STATES * j] = -3.0 * a * x[0] * x[0] * x[STATES * j];
        dx[STATES * j + 1] = -b * x[STATES * j + 1];
    }
    dx[0] /= 3.0;
    dx[STATES] -= x[0] * x[0] * x[0];
    dx[2 * STATES + 1] -= x[1];
    return STATUS_OK;
}

static enum status jacobian(double t, const double x[], double J[], void *context) {
    const double columns[STATES * STATES] = {-3.0 * a * x[0] * x[0], 0.0, 0.0, -b};
    memcpy(J, columns, sizeof columns);
    jacobian_count++;
    return STATUS_OK;
}

static void write_exact(double t, double x[ALL]) {
    const double root = sqrt(1.0 + 2.0 * a * t);
    const double decayed = exp(-b * t);
    memset(x, 0, ALL * sizeof *x);
    x[0] = 1.0 / root;
    x[1] = decayed;
    x[STATES] = -t / (root * root * root);
    x[2 * STATES + 1] = -t * decayed;
    x[3 * STATES] = 1.0 / (root * root * root);
}

static double largest_error(enum integrator_method method, double tolerance, int64_t *evaluations) {
    const struct ode ode = {
        .state_count = ALL, .gradient_count = GRADIENTS, .rhs = rhs, .jacobian = jacobian};
    double absolute[ALL];
    double start[ALL];
    double exact[ALL];
    double x[ALL];
    double reached = 0.0;
    struct integrator *integrator = NULL;
    for (int i = 0; i < ALL; i++) {
        absolute[i] = tolerance;
    }
    write_exact(0.0, start);
    write_exact(2.0, exact);
    jacobian_count = 0;
    ASSERT_OK(integrator_create(&ode, &last_text_sink, &integrator));
    ASSERT_OK(integrator_configure(
        integrator, &(struct integrator_settings){method, tolerance, absolute, 0.0}));
    ASSERT_OK(
        integrator_restart(integrator, start, &(struct integrator_start){.horizon = INFINITY}));
    ASSERT_OK(integrator_advance(integrator, 2.0, 100000, &reached, x));
    *evaluations = integrator_totals(integrator)->rhs_evaluations;
    integrator_destroy(integrator);
    double largest = 0.0;
    for (int i = 0; i < ALL; i++) {
        largest = fmax(largest, fabs(x[i] - exact[i]));
    }
    return largest;
}

void setUp(void) {}
void tearDown(void) {}

static void test_the_jacobian_of_the_states_serves_the_gradients(void) {
    double coarse = INFINITY;
    int64_t evaluations;
    for (int digits = 4; digits <= 10; digits += 2) {
        const double tolerance = pow(10.0, -digits);
        const double error = largest_error(INTEGRATOR_CVODE_BDF, tolerance, &evaluations);
        TEST_ASSERT_TRUE(error < 100.0 * tolerance);
        TEST_ASSERT_TRUE(error < coarse);
        coarse = error;
    }
}

/* An iteration without Newton's matrix would need as many as an explicit method. */
static void test_gradients_are_stiff_where_the_states_are(void) {
    int64_t evaluations;
    int64_t of_explicit;
    (void)largest_error(INTEGRATOR_CVODE_BDF, 1e-8, &evaluations);
    TEST_ASSERT_TRUE(jacobian_count > 0 && jacobian_count * 5 < evaluations);
    (void)largest_error(INTEGRATOR_ERK, 1e-8, &of_explicit);
    TEST_ASSERT_TRUE(4 * evaluations < of_explicit);
}
