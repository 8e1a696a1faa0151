/* A first step that cannot be found. */
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
