/* Every evaluation of the model fails in turn, once or from then on, by its status or by values
 * that are not finite. A step then ends at a correct state and can be undone. */
#include "captured_stderr.h"
#include "instance.h"
#include "last_text.h"
#include "oscillator.h"
#include "snapshot.h"
#include "stepping.h"
#include "values.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

/* ---- A model that fails --------------------------------------------------------------------- */

enum way { BY_STATUS, BY_NAN, BY_INFINITY, WAYS };
enum lasting { ONCE, ON, LASTINGS };

static struct {
    long until; /* evaluations to the first that fails */
    enum way way;
    enum lasting lasting;
    unsigned count;
} fault;

static unsigned failed_evaluations;

static void fail_from(long number, enum way way, enum lasting lasting) {
    fault.until = number;
    fault.way = way;
    fault.lasting = lasting;
    fault.count = 0;
}

static void fail_no_more(void) {
    fault.until = LONG_MAX;
}

static bool fails_now(void) {
    if (fault.until == LONG_MAX || --fault.until > 0 ||
        (fault.until < 0 && fault.lasting == ONCE)) {
        return false;
    }
    fault.count++;
    failed_evaluations++;
    return true;
}

/* What is written by a call that fails. */
static enum status spoil(double *value) {
    *value = fault.way == BY_NAN ? NAN : fault.way == BY_INFINITY ? -INFINITY : *value;
    return fault.way == BY_STATUS ? STATUS_OUT_OF_RANGE : STATUS_OK;
}

static enum status right_hand_side(const void *values, double t, const double x[], const double u[],
                                   double dx[]) {
    const enum status status = equations_model.right_hand_side(values, t, x, u, dx);
    return fails_now() ? spoil(&dx[1]) : status;
}

/* Of the method with Newton's iteration. */
static enum status jacobian(const void *values, double t, const double x[], const double u[],
                            double J[]) {
    const enum status status = equations_model.jacobian(values, t, x, u, J);
    return fails_now() ? spoil(&J[1]) : status;
}

static enum status extend(const struct series_origin *origin, int first, int last,
                          double row[][SERIES_LENGTH]) {
    const enum status status = equations_model.series->extend(origin, first, last, row);
    return fails_now() ? spoil(&row[1][last]) : status;
}

/* ---- Runs ----------------------------------------------------------------------------------- */

static const double start = 5.0;
static const double before_fault = 0.25; /* s: length of the step before the one that fails */
static const double step = 1.0;
static const double tolerance = 1e-6; /* of states, at the default of 1e-8 */

static struct instance *create(int method) {
    static struct model model;
    static struct series series;
    static struct model_description altered_description;
    const struct instance_experiment experiment = {.start_time = start};
    const unsigned reference = OSCILLATOR_solver_method;
    struct instance *instance = NULL;
    model = equations_model;
    model.right_hand_side = right_hand_side;
    model.jacobian = jacobian;
    series = *equations_model.series;
    series.extend = extend;
    model.series = &series;
    altered_description = model_description;
    altered_description.model = &model;
    ASSERT_OK(instance_create(&altered_description, &last_text_sink, &instance));
    ASSERT_OK(instance_set_integer(instance, &reference, 1, &method));
    if (method == INTEGRATOR_TAYLOR) { // whose steps are long
        const unsigned max_step = OSCILLATOR_max_step;
        const double most = 0.0625;
        ASSERT_OK(instance_set_real(instance, &max_step, 1, &most));
    }
    ASSERT_OK(instance_setup_experiment(instance, &experiment));
    ASSERT_OK(instance_enter_initialization(instance));
    ASSERT_OK(instance_exit_initialization(instance));
    return instance;
}

struct state {
    double x[2];
    double t;
};

static struct state state_of(struct instance *instance) {
    const unsigned references[] = {OSCILLATOR_x, OSCILLATOR_v};
    struct state state = {.t = instance_time(instance)};
    ASSERT_OK(instance_get_real(instance, references, 2, state.x));
    return state;
}

static void assert_on_solution(const struct state *state, const char *about) {
    double exact[2] = {1.0, 0.0};
    oscillator_solution(2.0, 0.0, state->t - start, exact, exact);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(tolerance, exact[0], state->x[0], about);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(tolerance, exact[1], state->x[1], about);
}

/* The result of the steps without a fault. */
static struct state expected_end(int method, bool has_first_step) {
    struct instance *instance = create(method);
    double t = start;
    if (has_first_step) {
        ASSERT_OK(instance_do_step(instance, t, before_fault, NULL));
        t += before_fault;
    }
    ASSERT_OK(instance_do_step(instance, t, step, NULL));
    const struct state end = state_of(instance);
    instance_destroy(instance);
    return end;
}

static char about[120];

/* Makes one step in which this evaluation fails. Returns whether there was such an evaluation. */
static bool try_step(int method, bool has_first_step, long number, enum way way,
                     enum lasting lasting, const struct state *expected) {
    struct instance_snapshot *snapshot = NULL;
    struct instance *instance = create(method);
    if (has_first_step) {
        ASSERT_OK(instance_do_step(instance, start, before_fault, NULL));
    }
    ASSERT_OK(instance_save(instance, 0, &snapshot));
    const struct state before = state_of(instance);
    snprintf(about, sizeof about, "method %d, first step %d, evaluation %ld, way %d, lasting %d",
             method, has_first_step, number, (int)way, (int)lasting);

    last_text[0] = '\0';
    fail_from(number, way, lasting);
    const enum status status = instance_do_step(instance, before.t, step, NULL);
    fail_no_more();
    const bool has_failed = fault.count > 0;
    const struct state reached = state_of(instance);
    assert_on_solution(&reached, about);
    if (status == STATUS_OK) {
        TEST_ASSERT_TRUE_MESSAGE(!has_failed || lasting == ONCE, about);
        TEST_ASSERT_TRUE_MESSAGE(reached.t == before.t + step, about);
    } else {
        TEST_ASSERT_EQUAL_INT_MESSAGE(STATUS_NOT_FINITE, status, about);
        TEST_ASSERT_TRUE_MESSAGE(reached.t >= before.t && reached.t < before.t + step, about);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(last_text, "a value is not finite"), last_text);
    }

    ASSERT_OK(instance_restore(instance, snapshot));
    ASSERT_OK(instance_do_step(instance, before.t, step, NULL));
    const struct state again = state_of(instance);
    TEST_ASSERT_EQUAL_MEMORY_MESSAGE(expected, &again, sizeof again, about);
    instance_destroy(instance);
    return has_failed;
}

static void fail_in_turn(int method, bool has_first_step) {
    const struct state expected = expected_end(method, has_first_step);
    for (int way = 0; way < WAYS; way++) {
        for (int lasting = 0; lasting < LASTINGS; lasting++) {
            long number = 1;
            while (try_step(method, has_first_step, number, (enum way)way, (enum lasting)lasting,
                            &expected)) {
                number++;
            }
            TEST_ASSERT_GREATER_THAN_INT(20, number);
        }
    }
}

static void test_each_method(void) {
    for (int method = INTEGRATOR_CVODE_ADAMS; method < INTEGRATOR_METHODS; method++) {
        fail_in_turn(method, false);
        fail_in_turn(method, true);
    }
}

void setUp(void) {
    fail_no_more();
    captured_stderr_begin();
}

void tearDown(void) {
    TEST_ASSERT_EQUAL_STRING("", captured_stderr_end());
}

int suiteTearDown(int failures) {
    printf("figures: model faults; executions %u; findings %d\n", failed_evaluations, failures);
    return failures;
}
