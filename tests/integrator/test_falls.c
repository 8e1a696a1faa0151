/* Falls of an indicator: a later one need not be located where an event comes before it, and one
 * that a restart finds below 0 has not fallen yet. */
#include "integrator_test.h"
#include "location.h"

#include <stdint.h>
#include <unity.h>

static uint64_t seed = 1;

/* In [-1, 1). */
static double chance(void) {
    seed = seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (double)(seed >> 11) * 0x1p-52 - 1.0;
}

/* Indicators that begin above 0, close to it or at it, and fall soon, late or never. */
static int draw(long i, double c[ROOTS_LENGTH]) {
    const int degree = 1 + (int)(i % 20);
    double size = 1.0;
    for (int k = 0; k <= degree; k++) {
        c[k] = size * chance();
        size *= i % 3 == 0 ? 1.0 : 0.25;
    }
    c[0] = i % 4 == 0 ? 0.0 : fabs(c[0]) * (i % 4 == 1 ? 1.0 : 1e-9);
    c[1] = i % 4 == 0 ? fabs(c[1]) : c[1];
    return degree;
}

static void test_a_fall_up_to_the_latest_is_located_to_the_same_bit(void) {
    int left_out = 0;
    int located = 0;
    for (long i = 0; i < 200000; i++) {
        double c[ROOTS_LENGTH] = {0.0};
        const struct roots_polynomial p = {c, draw(i, c), -1.0};
        bool is_armed = c[0] > 0.0 && i % 8 < 6;
        bool is_armed_too = is_armed;
        double noise = i % 8 < 4 ? 1e-15 : 1e-10;
        double same_noise = noise;
        const double s = roots_first_fall(&p, &(struct fall){.latest = INFINITY,
                                                             .is_restart = true,
                                                             .is_armed = &is_armed,
                                                             .noise = &noise});
        const bool is_close = s <= 1.0 && i % 5 == 0;
        const double latest = is_close ? s * (1.0 + 1e-15 * chance()) : fabs(chance());
        const double found = roots_first_fall(&p, &(struct fall){.latest = latest,
                                                                 .is_restart = true,
                                                                 .is_armed = &is_armed_too,
                                                                 .noise = &same_noise});
        if (s <= latest) {
            TEST_ASSERT_TRUE(found == s);
            located++;
        } else {
            TEST_ASSERT_TRUE(found == s || found == INFINITY);
            left_out += found != s;
        }
    }
    TEST_ASSERT_TRUE(located > 10000);
    TEST_ASSERT_TRUE(left_out > 10000);
}

static double fall_within(const double c[], int degree, double noise, bool *is_armed) {
    const struct roots_polynomial p = {c, degree, -1.0};
    return roots_first_fall(
        &p, &(struct fall){
                .latest = INFINITY, .is_restart = true, .is_armed = is_armed, .noise = &noise});
}

/* p = -s (1 - 4 s) (1 - s / 0.9) / 10: the first fall counts only because p has been above the
 * noise before, between 0.4 and 0.9. s (0.1 - s) is never above it. */
static void test_an_indicator_that_rises_above_its_noise_is_armed(void) {
    const double rising[] = {0.0, -0.1, 0.4 + 0.1 / 0.9, -0.4 / 0.9};
    const double bent[] = {0.0, 0.1, -1.0};
    bool is_armed = false;
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 0.9, fall_within(rising, 3, 0.02, &is_armed));
    TEST_ASSERT_TRUE(is_armed);
    is_armed = false;
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 0.1, fall_within(bent, 2, 0.02, &is_armed));
    TEST_ASSERT_FALSE(is_armed);
}

/* p = (s - 0.5)^2 - 1e-6 */
static void test_a_dip_within_the_touch_is_no_fall(void) {
    const double c[ROOTS_LENGTH] = {0.25 - 1e-6, -1.0, 1.0};
    for (int k = 0; k < 2; k++) {
        bool is_armed = true;
        double noise = 0.0;
        const double s = roots_first_fall(&(struct roots_polynomial){c, 2, -1.0},
                                          &(struct fall){.touch = k == 0 ? 1e-7 : 1e-5,
                                                         .latest = INFINITY,
                                                         .is_armed = &is_armed,
                                                         .noise = &noise});
        TEST_ASSERT_TRUE(k == 0 ? fabs(s - 0.499) < 1e-12 : s == INFINITY);
    }
}

/* ---- Indicators that are below 0 at a restart -------------------------------------------------
 */

/* The modes have just been found valid there. One state, x' = rate. */
static const double below = -1e-6;
static const size_t row_of_indicator[1] = {0};
static const struct series rows = {.row_count = 1, .row_of_indicator = row_of_indicator};
static double rate;
static enum { LINE, SINE, SWING, JUMP, NOISE } shape;
static int calls; /* of the indicator */
static const double pi = 3.141592653589793;
static struct integrator *integrator;

void setUp(void) {
    integrator = NULL;
    shape = LINE;
    calls = 0;
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

/* Period: half of 0.05 s. */
static double swing(double t) {
    return 0.5 + 0.6 * cos(80.0 * pi * (t - 0.5));
}

static enum status indicators(double t, const double x[], double z[], void *context) {
    calls++;
    z[0] = shape == LINE    ? x[0]
           : shape == SINE  ? sin(x[0]) - 0.01
           : shape == JUMP  ? (t < 0.3 ? 1.0 : -1.0)
           : shape == NOISE ? 1.0 + 0.5 * chance()
           : t < 0.5        ? 1.1
                            : swing(t);
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
        .rows = shape == LINE || shape == SINE ? &rows : NULL,
        .indicator_count = 1,
        .indicators = indicators,
    };
    const int advances = shape == SWING ? 20 : 1;
    const struct indicator indicator = {.kind = kind, .factor = 1.0};
    const struct integrator_start from = {.horizon = INFINITY, .indicators = &indicator};
    const struct message_sink quiet = {0};
    double x[1] = {below};
    double reached = 0.0;
    ASSERT_OK(integrator_create(&ode, &quiet, &integrator));
    configure_integrator(integrator, method, 1e-12, 1.0 / advances);
    ASSERT_OK(integrator_restart(integrator, x, &from));
    for (int i = 1; i <= advances && reached == (i - 1.0) / advances; i++) {
        ASSERT_OK(integrator_advance(integrator, (double)i / advances, 100000, &reached, x));
    }
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

/* An indicator of the time that was calm, then swings so that it is the same at the begin, the
 * middle and the end of each step. */
static void test_a_swing_that_fits_the_steps_is_seen(void) {
    shape = SWING;
    rate = 0.0;
    for (int method = 1; method < INTEGRATOR_METHODS; method++) {
        const double fallen = run(method, INDICATOR_OF_MODEL);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5 + acos(-0.5 / 0.6) / (80.0 * pi), fallen);
    }
}

/* How far below 0 an indicator begins is no error of its later falls. */
static void test_later_falls_are_located_exactly(void) {
    shape = SINE;
    rate = 4.0;
    for (int method = 1; method < INTEGRATOR_METHODS; method++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, (pi - asin(0.01) - below) / rate,
                                  run(method, INDICATOR_OF_MODEL));
    }
}

/* A step is divided to 2^-10 of its length, where no polynomial represents the indicator. */
static void test_a_jump_is_located_in_the_shortest_piece(void) {
    shape = JUMP;
    rate = 0.0;
    for (int method = 1; method < INTEGRATOR_METHODS; method++) {
        calls = 0;
        TEST_ASSERT_DOUBLE_WITHIN(0x1p-10, 0.3, run(method, INDICATOR_OF_MODEL));
        TEST_ASSERT_LESS_THAN_INT(260, calls); // each division samples 22 points or so
    }
}

/* A step is not divided further where its halves have the same error: the indicator is rounding. */
static void test_noise_is_not_divided_to_the_shortest_pieces(void) {
    shape = NOISE;
    rate = 0.0;
    for (int method = 1; method < INTEGRATOR_METHODS; method++) {
        calls = 0;
        TEST_ASSERT_TRUE(run(method, INDICATOR_OF_MODEL) == 1.0);
        TEST_ASSERT_LESS_THAN_INT(5000, calls); // up to 150 000 with all pieces
    }
}
