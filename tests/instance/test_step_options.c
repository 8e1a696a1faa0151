/* What a step does on its way: inputs at four times, and the limit of internal steps that are
 * reported. With each method, on the oscillator. The rest: tests/fmi3. */
#include "clock.h"
#include "each_method.h"
#include "one_instance.h"
#include "oscillator_by_hand.h"

void setUp(void) {
    create(&oscillator_description);
    set_int(OSCILLATOR_SOLVER_METHOD, method);
    set(OSCILLATOR_MAX_STEP, 0.25); // so that all methods need some steps
    initialize_at(1.0);
}

/* ---- Inputs --------------------------------------------------------------------------------- */

/* u = 1 - t + t^2 - 2 t^3 after the start at 1 s. */
static double cubic(double time) {
    const double t = time - 1.0;
    return 1.0 - t * (1.0 - t * (1.0 - 2.0 * t));
}

static unsigned asked;

static enum status set_cubic(void *context, double time) {
    asked++;
    set(OSCILLATOR_U, cubic(time));
    return STATUS_OK;
}

/* x'' = -omega^2 x + u with u a cubic and x(0) = 1, x'(0) = 0: a particular cubic and the free
 * motion. */
static double solution(double time) {
    const double t = time - 1.0;
    const double w2 = 4.0; // omega = 2
    const double c[4] = {1.0, -1.0, 1.0, -2.0};
    const double p3 = c[3] / w2;
    const double p2 = c[2] / w2;
    const double p1 = (c[1] - 6.0 * p3) / w2;
    const double p0 = (c[0] - 2.0 * p2) / w2;
    return p0 + t * (p1 + t * (p2 + t * p3)) + (1.0 - p0) * cos(2.0 * t) - p1 / 2.0 * sin(2.0 * t);
}

EACH_METHOD static void test_a_cubic_input_is_exact(void) {
    const struct step_options options = {.ask_inputs = set_cubic};
    asked = 0;
    for (int i = 0; i < 4; i++) {
        ASSERT_OK(instance_do_step_with(instance, 1.0 + 0.25 * i, 0.25, &options));
        TEST_ASSERT_TRUE(get(OSCILLATOR_U) == cubic(1.25 + 0.25 * i));
    }
    TEST_ASSERT_EQUAL_UINT(4 * POLYNOMIAL_NODES, asked);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, solution(2.0), get(OSCILLATOR_X));
    // afterwards it is held at its last value
    const double held = get(OSCILLATOR_U);
    ASSERT_OK(instance_do_step(instance, 2.0, 0.25));
    TEST_ASSERT_TRUE(held == get(OSCILLATOR_U));
}

/* ---- Reports -------------------------------------------------------------------------------- */

static struct {
    unsigned count;
    double last;   /* s */
    double end_at; /* s: returned at the third report */
    enum status status;
    double largest_error;
} reports;

static enum status note(void *context, double time, double *end) {
    TEST_ASSERT_EQUAL_PTR(&reports, context);
    TEST_ASSERT_TRUE(time > reports.last && time <= *end);
    TEST_ASSERT_TRUE(get(OSCILLATOR_TIME) == time);
    reports.last = time;
    reports.largest_error =
        fmax(reports.largest_error, fabs(get(OSCILLATOR_X) - cos(2.0 * (time - 1.0))));
    if (++reports.count == 3 && reports.end_at > 0.0) {
        *end = reports.end_at;
        return reports.status;
    }
    return STATUS_OK;
}

static const struct step_options noting = {.accept = note, .context = &reports};

static void begin_noting(double end_at, enum status status) {
    memset(&reports, 0, sizeof reports);
    reports.end_at = end_at;
    reports.status = status;
}

/* Asked for the end of internal steps, a step may take as many of them as without. */
EACH_METHOD static void test_the_limit_of_internal_steps_holds_over_early_ends(void) {
    create(&oscillator_description);
    set_int(OSCILLATOR_SOLVER_METHOD, method);
    set_int(OSCILLATOR_MAX_STEPS, 12);
    initialize_at(1.0);
    begin_noting(90.0, STATUS_OK);
    TEST_ASSERT_EQUAL_INT(STATUS_TOO_MANY_STEPS,
                          instance_do_step_with(instance, 1.0, 99.0, &noting));
    TEST_ASSERT_LESS_OR_EQUAL_UINT(12, reports.count);
}
