/* What a step does on its way: inputs at four times, reports of internal steps, and nothing at all
 * where it fails. With each method, on the oscillator. */
#include "instance.h"

#include "allocations.h"
#include "each_method.h"
#include "last_text.h"
#include "oscillator_by_hand.h"
#include "polynomial.h"
#include "snapshot.h"
#include "stepping.h"
#include "values.h"

#include <math.h>
#include <string.h>
#include <unity.h>

static struct instance *instance;

static void create(void) {
    const unsigned reference = OSCILLATOR_SOLVER_METHOD;
    ASSERT_OK(instance_create(&oscillator_description, &last_text_sink, &instance));
    ASSERT_OK(instance_set_integer(instance, &reference, 1, &method));
    const unsigned limited = OSCILLATOR_MAX_STEP;
    const double max_step = 0.25; // so that all methods need some steps
    ASSERT_OK(instance_set_real(instance, &limited, 1, &max_step));
    const struct instance_experiment experiment = {.start_time = 1.0};
    ASSERT_OK(instance_setup_experiment(instance, &experiment));
    ASSERT_OK(instance_enter_initialization(instance));
    ASSERT_OK(instance_exit_initialization(instance));
}

void setUp(void) {
    memset(last_text, 0, sizeof last_text);
    create();
}

void tearDown(void) {
    instance_destroy(instance);
}

static double get(unsigned reference) {
    double value = NAN;
    ASSERT_OK(instance_get_real(instance, &reference, 1, &value));
    return value;
}

static void set_input(double value) {
    const unsigned reference = OSCILLATOR_U;
    ASSERT_OK(instance_set_real(instance, &reference, 1, &value));
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
    set_input(cubic(time));
    return STATUS_OK;
}

static enum status refuse(void *context, double time) {
    return STATUS_INVALID_ARGUMENT;
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

EACH_METHOD static void test_a_refusal_ends_the_step(void) {
    const struct step_options options = {.ask_inputs = refuse};
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT,
                          instance_do_step_with(instance, 1.0, 0.5, &options));
    TEST_ASSERT_TRUE(instance_time(instance) == 1.0);
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

EACH_METHOD static void test_internal_steps_and_the_end_are_reported(void) {
    begin_noting(0.0, STATUS_OK);
    ASSERT_OK(instance_do_step_with(instance, 1.0, 3.0, &noting));
    TEST_ASSERT_GREATER_THAN_UINT(10, reports.count);
    TEST_ASSERT_TRUE(reports.last == 4.0);
    TEST_ASSERT_TRUE(reports.largest_error < 1e-6);
}

EACH_METHOD static void test_a_report_may_bring_the_end_forward(void) {
    begin_noting(2.0, STATUS_OK);
    ASSERT_OK(instance_do_step_with(instance, 1.0, 3.0, &noting));
    TEST_ASSERT_TRUE(instance_time(instance) == 2.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, cos(2.0), get(OSCILLATOR_X));
    ASSERT_OK(instance_do_step(instance, 2.0, 2.0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, cos(6.0), get(OSCILLATOR_X));
}

EACH_METHOD static void test_a_report_may_end_the_step_at_once(void) {
    begin_noting(0.5, STATUS_OK); // before the step
    ASSERT_OK(instance_do_step_with(instance, 1.0, 3.0, &noting));
    TEST_ASSERT_EQUAL_UINT(3, reports.count);
    TEST_ASSERT_TRUE(instance_time(instance) == reports.last);
    ASSERT_OK(instance_do_step(instance, reports.last, 0.5));
}

EACH_METHOD static void test_a_report_may_fail_the_step(void) {
    begin_noting(INFINITY, STATUS_INVALID_ARGUMENT);
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT,
                          instance_do_step_with(instance, 1.0, 3.0, &noting));
    TEST_ASSERT_EQUAL_UINT(3, reports.count);
}

/* Asked for the end of internal steps, a step may take as many of them as without. */
EACH_METHOD static void test_the_limit_of_internal_steps_holds_over_early_ends(void) {
    const unsigned reference = OSCILLATOR_MAX_STEPS;
    const int few = 12;
    tearDown();
    ASSERT_OK(instance_create(&oscillator_description, &last_text_sink, &instance));
    const unsigned solver = OSCILLATOR_SOLVER_METHOD;
    ASSERT_OK(instance_set_integer(instance, &solver, 1, &method));
    ASSERT_OK(instance_set_integer(instance, &reference, 1, &few));
    const struct instance_experiment experiment = {.start_time = 1.0};
    ASSERT_OK(instance_setup_experiment(instance, &experiment));
    ASSERT_OK(instance_enter_initialization(instance));
    ASSERT_OK(instance_exit_initialization(instance));
    begin_noting(90.0, STATUS_OK);
    TEST_ASSERT_EQUAL_INT(STATUS_TOO_MANY_STEPS,
                          instance_do_step_with(instance, 1.0, 99.0, &noting));
    TEST_ASSERT_LESS_OR_EQUAL_UINT(12, reports.count);
}

/* ---- Undo ----------------------------------------------------------------------------------- */

/* The rest is in the tests of the FMU of FMI 3.0. */
EACH_METHOD static void test_a_failed_step_is_undone_and_allocates_nothing(void) {
    struct instance_snapshot *undo = NULL;
    ASSERT_OK(instance_save(instance, 0, &undo));
    const struct step_options options = {.undo = undo};
    ASSERT_OK(instance_do_step_with(instance, 1.0, 0.5, &options));
    const double x = get(OSCILLATOR_X);
    const long before = allocation_count();
    set_input(1.7e308);
    const enum status failed = instance_do_step_with(instance, 1.5, 10.0, &options);
    TEST_ASSERT_EQUAL_INT(before, allocation_count());
    TEST_ASSERT_EQUAL_INT(SEVERITY_DISCARD, status_severity(failed));
    TEST_ASSERT_TRUE(instance_time(instance) == 1.5);
    TEST_ASSERT_TRUE(x == get(OSCILLATOR_X));
    set_input(0.0);
    ASSERT_OK(instance_do_step_with(instance, 1.5, 0.5, &options));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, cos(2.0), get(OSCILLATOR_X));
}
