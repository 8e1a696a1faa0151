/* Indicators that are below 0 where a restart finds them: the modes have just been found valid, so
 * that they have not fallen yet. One state, x' = rate. */
#include "integrator_test.h"

static const double below = -1e-6;
static const size_t row_of_indicator[1] = {0};
static double rate;
static bool is_curved; // true if the indicator is sin x - 0.01, false if it is x
static struct integrator *integrator;

void setUp(void) {
    integrator = NULL;
    is_curved = false;
}

void tearDown(void) {
    integrator_destroy(integrator);
}

static enum status rhs(double t, const double x[], double dx[], void *context) {
    dx[0] = rate;
    return STATUS_OK;
}

static enum status jacobian(double t, const double x[], double J[], void *context) {
    J[0] = 0.0;
    return STATUS_OK;
}

static enum status series(double t, double time_scale, int first, int last,
                          double row[][SERIES_LENGTH], void *context) {
    for (int k = first; k <= last; k++) {
        if (k > 0) {
            row[0][k] = k == 1 ? time_scale * rate : 0.0;
        }
    }
    return STATUS_OK;
}

static enum status indicators(double t, const double x[], double z[], void *context) {
    z[0] = is_curved ? sin(x[0]) - 0.01 : x[0];
    return STATUS_OK;
}

/* From x = below to the time 1 s, or to an event; the time there. */
static double run(int method, enum indicator_kind kind) {
    const struct ode ode = {
        .state_count = 1,
        .rhs = rhs,
        .jacobian = jacobian,
        .series = series,
        .series_row_count = 1,
        .row_of_indicator = row_of_indicator,
        .indicator_count = 1,
        .indicators = indicators,
    };
    const struct indicator indicator = {.kind = kind, .factor = 1.0};
    const struct integrator_start from = {.horizon = INFINITY, .indicators = &indicator};
    const struct message_sink quiet = {0};
    double x[1] = {below};
    double reached;
    ASSERT_OK(integrator_create(&ode, &quiet, &integrator));
    configure_integrator(integrator, method, 1e-12, 0.0);
    ASSERT_OK(integrator_restart(integrator, x, &from));
    ASSERT_OK(integrator_advance(integrator, 1.0, 100000, &reached, x));
    TEST_ASSERT_EQUAL_INT(reached < 1.0, integrator_event(integrator) != NULL);
    integrator_destroy(integrator);
    integrator = NULL;
    return reached;
}

static void test_only_a_fall_from_where_it_was_counts(void) {
    static const enum indicator_kind kinds[] = {INDICATOR_OF_STATE, INDICATOR_OF_MODEL};
    for (int method = 1; method < INTEGRATOR_METHODS; method++) {
        for (int k = 0; k < 2; k++) {
            rate = 0.0;
            TEST_ASSERT_TRUE(run(method, kinds[k]) == 1.0);
            rate = 0.1;
            TEST_ASSERT_TRUE(run(method, kinds[k]) == 1.0);
            rate = -0.1;
            const double fallen = run(method, kinds[k]);
            TEST_ASSERT_TRUE(fallen > 1e-9 && fallen < 1.001e-5);
        }
    }
}

/* How far below 0 an indicator begins is no error of its later falls. */
static void test_later_falls_are_located_exactly(void) {
    const double pi = 3.141592653589793;
    is_curved = true;
    rate = 4.0;
    for (int method = 1; method < INTEGRATOR_METHODS; method++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, (pi - asin(0.01) - below) / rate,
                                  run(method, INDICATOR_OF_MODEL));
    }
}
