/* The Jacobian that the implicit method gets from the model, and the evaluations it saves. */
#include "history.h"
#include "one_instance.h"
#include "oscillator.h"

/* The oscillator with a spring that depends on position, time and input, and with damping:
 * x'' = -omega^2 (1 + t + u) sin x - gain x'. */
static double stiffness(const struct equations_values *values, double t, double u) {
    return values->v_omega * values->v_omega * (1.0 + t + u);
}

static enum status right_hand_side(const void *values_pointer, double t, const double x[],
                                   const double u[], double dx[]) {
    const struct equations_values *values = values_pointer;
    dx[0] = x[1];
    dx[1] = -stiffness(values, t, u[0]) * sin(x[0]) - values->v_gain * x[1];
    return STATUS_OK;
}

static enum status jacobian(const void *values_pointer, double t, const double x[],
                            const double u[], double J[]) {
    const struct equations_values *values = values_pointer;
    J[0] = 0.0;
    J[1] = -stiffness(values, t, u[0]) * cos(x[0]);
    J[2] = 1.0;
    J[3] = -values->v_gain;
    return STATUS_OK;
}

static struct model model;
static struct model_description altered_description;

void setUp(void) {
    model = equations_model;
    model.right_hand_side = right_hand_side;
    model.jacobian = jacobian;
    altered_description = model_description;
    altered_description.model = &model;
}

static const double start = 5.0; /* s */

static void begin(int method, double omega, double gain) {
    create(&altered_description);
    set_int(OSCILLATOR_solver_method, method);
    set(OSCILLATOR_omega, omega);
    set(OSCILLATOR_gain, gain);
    initialize_at(start);
}

/* ---- With which values it is evaluated ------------------------------------------------------ */

/* Newton's iteration takes it where it has just evaluated the right-hand side. */
static struct { double omega, t, x[2], u; } latest;

/* The input as the test has set it: at a time, and from there on. */
static struct { double omega, t, u, slope; } expected;

static int jacobians;

static void assert_expected(const struct equations_values *values, double t, double u) {
    TEST_ASSERT_TRUE(values->v_omega == expected.omega);
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, expected.u + expected.slope * (t - expected.t), u);
}

static enum status watched_rhs(const void *values_pointer, double t, const double x[],
                               const double u[], double dx[]) {
    const struct equations_values *values = values_pointer;
    assert_expected(values, t, u[0]);
    latest.omega = values->v_omega;
    latest.t = t;
    memcpy(latest.x, x, sizeof latest.x);
    latest.u = u[0];
    return right_hand_side(values, t, x, u, dx);
}

static enum status watched_jacobian(const void *values_pointer, double t, const double x[],
                                    const double u[], double J[]) {
    const struct equations_values *values = values_pointer;
    jacobians++;
    assert_expected(values, t, u[0]);
    TEST_ASSERT_TRUE(t == latest.t && u[0] == latest.u && values->v_omega == latest.omega);
    TEST_ASSERT_EQUAL_MEMORY(latest.x, x, sizeof latest.x);
    return jacobian(values, t, x, u, J);
}

/* Steps with inputs that are held for some, change and move, and with another parameter in the
 * second half; what is set for the next step must not be seen before. */
static void run_watched(int method) {
    const double h = 1.0 / 16.0;
    model.right_hand_side = watched_rhs;
    model.jacobian = watched_jacobian;
    jacobians = 0;
    expected.omega = 2.0;
    expected.t = start;
    expected.u = expected.slope = 0.0;
    begin(method, expected.omega, 1.0);
    for (int i = 0; i < 64; i++) {
        if (i % 4 == 1) {
            expected.u = 0.25 * (i % 5) + 0.125;
            set(OSCILLATOR_u, expected.u);
        }
        expected.t = start + i * h;
        expected.slope = i % 4 == 3 ? 3.0 : 0.0;
        if (expected.slope != 0.0) {
            set_input_derivative(OSCILLATOR_u, 1, expected.slope);
        }
        if (i == 32) {
            expected.omega = 3.0;
            set(OSCILLATOR_omega, expected.omega);
        }
        ASSERT_OK(instance_do_step(instance, expected.t, h, NULL));
    }
}

static void test_it_is_taken_where_the_right_hand_side_was(void) {
    run_watched(INTEGRATOR_CVODE_BDF);
    TEST_ASSERT_GREATER_THAN_INT(32, jacobians);
    TEST_ASSERT_LESS_THAN_INT(get_int(OSCILLATOR_solver_rhs_evaluations) / 2, jacobians);
}

static void test_explicit_methods_do_without(void) {
    run_watched(INTEGRATOR_CVODE_ADAMS);
    TEST_ASSERT_EQUAL_INT(0, jacobians);
    run_watched(INTEGRATOR_ERK);
    TEST_ASSERT_EQUAL_INT(0, jacobians);
}

/* ---- What it is worth ----------------------------------------------------------------------- */

static enum status transposed_jacobian(const void *values, double t, const double x[],
                                       const double u[], double J[]) {
    const enum status status = jacobian(values, t, x, u, J);
    const double above = J[2];
    J[2] = J[1];
    J[1] = above;
    return status;
}

/* Of another time and input. */
static enum status late_jacobian(const void *values, double t, const double x[], const double u[],
                                 double J[]) {
    return jacobian(values, t + 10.0, x, (const double[]){u[0] + 10.0}, J);
}

static enum status no_jacobian(const void *values, double t, const double x[], const double u[],
                               double J[]) {
    memset(J, 0, sizeof(double[4]));
    return STATUS_OK;
}

/* Evaluations in a second of a stiff motion. With a wrong one, the last bits of the sine decide
 * whether the steps allowed are enough: those that are not are many evaluations, too. */
static int evaluations(enum status with(const void *values, double t, const double x[],
                                        const double u[], double J[])) {
    model.jacobian = with;
    begin(INTEGRATOR_CVODE_BDF, 100.0, 2000.0);
    set(OSCILLATOR_u, 1.0);
    const enum status status = instance_do_step(instance, start, 1.0, NULL);
    TEST_ASSERT_TRUE(status == STATUS_OK || (with != jacobian && status == STATUS_TOO_MANY_STEPS));
    return get_int(OSCILLATOR_solver_rhs_evaluations);
}

/* With the right one nearly every step takes one evaluation. */
static void test_a_wrong_one_shows_in_the_evaluations(void) {
    const int right = evaluations(jacobian);
    TEST_ASSERT_LESS_THAN_INT(get_int(OSCILLATOR_solver_steps) * 11 / 10, right);
    TEST_ASSERT_GREATER_THAN_INT(right * 5 / 4, evaluations(late_jacobian));
    TEST_ASSERT_GREATER_THAN_INT(right * 5 / 4, evaluations(transposed_jacobian));
    TEST_ASSERT_GREATER_THAN_INT(right * 5 / 4, evaluations(no_jacobian));
}

/* The Jacobian belongs to its own time: inputs are evaluated there, not where the right-hand side
 * was asked for last. */
static void test_inputs_are_those_of_the_jacobians_time(void) {
    begin(INTEGRATOR_CVODE_BDF, 3.0, 0.5);
    set(OSCILLATOR_u, 0.25);
    set_input_derivative(OSCILLATOR_u, 1, 2.0);
    ASSERT_OK(instance_do_step(instance, start, 0.5, NULL));
    const double x[2] = {0.3, -0.1};
    double dx[2];
    double J[4];
    ASSERT_OK(instance_rhs(0.0, x, dx, instance));
    ASSERT_OK(instance_jacobian(0.125, x, J, instance));
    const double stiffness_then = 3.0 * 3.0 * (1.0 + start + 0.125 + 0.25 + 2.0 * 0.125);
    TEST_ASSERT_DOUBLE_WITHIN(1e-14 * stiffness_then, -stiffness_then * cos(0.3), J[1]);
    TEST_ASSERT_EQUAL_DOUBLE(-0.5, J[3]);
}
