/* The length of a first step, and a first step that cannot be found. */
#include "integrator_test.h"

static struct integrator *integrator;

void setUp(void) {}

void tearDown(void) {
    integrator_destroy(integrator);
    integrator = NULL;
}

/* A spring of stiffness 1e300. Where it begins decides how the norm of the derivatives overflows.
 */
static enum status spring_rhs(double t, const double x[], double dx[], void *context) {
    dx[0] = x[1];
    dx[1] = -1e300 * x[0];
    return STATUS_OK;
}

static enum status spring_jacobian(double t, const double x[], double J[], void *context) {
    static const double columns[4] = {0.0, -1e300, 1.0, 0.0};
    memcpy(J, columns, sizeof columns);
    return STATUS_OK;
}

static void test_derivatives_that_are_too_large_are_named(void) {
    static const double start[2] = {1.0, 0.0};
    const struct ode ode = {.state_count = 2, .rhs = spring_rhs, .jacobian = spring_jacobian};
    const struct integrator_start from = {.horizon = INFINITY};
    double x[2];
    double reached;
    ASSERT_OK(integrator_create(&ode, &last_text_sink, &integrator));
    configure_integrator(integrator, INTEGRATOR_CVODE_ADAMS, 1e-8, 0.0);
    ASSERT_OK(integrator_restart(integrator, start, &from));
    TEST_ASSERT_EQUAL_INT(STATUS_NO_CONVERGENCE,
                          integrator_advance(integrator, 1.0, 1000, &reached, x));
    TEST_ASSERT_EQUAL_STRING("cvode_adams: the derivatives of the states are too large for a first "
                             "step",
                             last_text);
    TEST_ASSERT_TRUE(reached == 0.0 && x[0] == 1.0 && x[1] == 0.0);
}

/* ---- After an event ------------------------------------------------------------------------- */

static const double acceleration = 8.0;

static enum status throw_rhs(double t, const double x[], double dx[], void *context) {
    dx[0] = x[1];
    dx[1] = acceleration;
    return STATUS_OK;
}

static enum status no_indicators(double t, const double x[], double z[], void *context) {
    return STATUS_OK;
}

static bool end_at_first_step(void *context, double t, const double x[]) {
    *(double *)context = t;
    return true;
}

/* Its error h^2 x'' / 2 is 0.003^2 of the tolerance, whatever the velocity. */
static void test_the_first_step_after_an_event_follows_from_the_curvature(void) {
    const struct ode ode = {
        .state_count = 2, .rhs = throw_rhs, .indicator_count = 1, .indicators = no_indicators};
    const struct indicator far = {.kind = INDICATOR_OF_STATE, .factor = 1.0, .offset = 1e9};
    const struct integrator_start from = {
        .horizon = INFINITY, .continues = true, .indicators = &far};
    const double tolerance = 1e-8;
    const double weight = tolerance * 1.0 + 1e-2 * tolerance;
    const double expected = 0.003 * sqrt(2.0 * sqrt(2.0) * weight / acceleration);
    for (double velocity = 0.0; velocity < 100.0; velocity += 30.0) {
        const double start[2] = {1.0, velocity};
        double x[2];
        double reached;
        double first = 0.0;
        ASSERT_OK(integrator_create(&ode, &last_text_sink, &integrator));
        configure_integrator(integrator, INTEGRATOR_CVODE_ADAMS, tolerance, 0.0);
        integrator_set_observer(integrator, end_at_first_step, &first);
        ASSERT_OK(integrator_restart(integrator, start, &from));
        ASSERT_OK(integrator_advance(integrator, 1.0, 1000, &reached, x));
        TEST_ASSERT_DOUBLE_WITHIN(1e-3 * expected, expected, first);
        tearDown();
    }
}
