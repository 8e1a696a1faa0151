/* Times as sums of two doubles, and inputs as polynomials of them. */
#include "clock.h"

#include <math.h>
#include <unity.h>

/* ---- Times ---------------------------------------------------------------------------------- */

static void test_no_time_is_lost_where_doubles_are_coarse(void) {
    // at 1e6 s doubles are 1.2e-10 s apart: each of these steps would be rounded by up to half of
    // it
    const struct clock_time start = {.s = 1e6};
    struct clock_time time = start;
    for (int i = 0; i < 1024 * 1024; i++) {
        time = clock_add(time, 0x1p-40);
    }
    TEST_ASSERT_EQUAL_DOUBLE(1.0 / (1 << 20), clock_difference(time, start));
}

static void test_accumulated_steps_meet_their_exact_sum(void) {
    struct clock_time time = {0};
    double rounded = 0.0;
    for (int i = 0; i < 600000; i++) {
        time = clock_add(time, 1e-3);
        rounded += 1e-3;
    }
    // 600000 times the double nearest to 1e-3, in extended precision
    const long double exact = 600000.0L * (long double)1e-3;
    TEST_ASSERT_TRUE(fabsl((long double)time.s + time.rest - exact) < 1e-25L * 600000.0L + 1e-17L);
    TEST_ASSERT_TRUE(fabs(rounded - 600.0) > 1e-9);
}

static void test_time_is_the_rounded_sum(void) {
    const struct clock_time time = clock_add((struct clock_time){.s = 0.1, .rest = 1e-18}, 0.2);
    TEST_ASSERT_EQUAL_DOUBLE(0.1 + 0.2, time.s);
    TEST_ASSERT_TRUE(fabs(time.rest) <= 0.5 * 0x1p-53);
}

static void test_difference_has_the_sign_of_later_minus_earlier(void) {
    const struct clock_time earlier = {.s = -0.5};
    const struct clock_time later = {.s = 0.25, .rest = 1e-20};
    TEST_ASSERT_EQUAL_DOUBLE(0.75, clock_difference(later, earlier));
    TEST_ASSERT_EQUAL_DOUBLE(-0.75, clock_difference(earlier, later));
}

static void test_slack_is_small_against_time_and_step(void) {
    TEST_ASSERT_EQUAL_DOUBLE(1e-9 * 2.0, clock_slack(2.0, 0.1));
    TEST_ASSERT_EQUAL_DOUBLE(1e-9 * 0.1, clock_slack(0.0, 0.1));
    TEST_ASSERT_EQUAL_DOUBLE(1e-3 / 100.0, clock_slack(1e6, 1e-3));
}

static void test_slack_covers_the_rounding_of_a_communication_point(void) {
    const double spacing = nextafter(1e6, INFINITY) - 1e6;
    TEST_ASSERT_TRUE(clock_slack(1e6, 2.0 * spacing) >= spacing);
}

static void test_the_slack_of_a_tick_is_the_drift_within_the_slack_of_the_step(void) {
    static const double h = 1e-3;
    TEST_ASSERT_TRUE(clock_tick_slack(1e3, h, 0.0) == clock_rounding(1e3));
    TEST_ASSERT_DOUBLE_WITHIN(1e-20, 1e-9 + clock_rounding(1.0), clock_tick_slack(1.0, h, 1e-9));
    TEST_ASSERT_EQUAL_DOUBLE(h / 100.0, clock_tick_slack(1.0, h, 1.0));
    TEST_ASSERT_TRUE(clock_tick_slack(1e9, h, 1.0) == h / 100.0);
    TEST_ASSERT_TRUE(clock_tick_slack(1e9, 1e-6, 1.0) == clock_rounding(1e9));
}

/* What a step accepts at its beginning is accepted at its end, too. */
static void test_the_drift_of_a_step_is_at_least_its_mismatch(void) {
    TEST_ASSERT_TRUE(clock_step_drift(1e3, -1e-6) == 1e-6);
    TEST_ASSERT_TRUE(clock_step_drift(1024.0, 0.0) == 0x1p-43);
}

/* Two times that are the same double differ by what rounding left over. */
static void test_rests_count_with_their_signs(void) {
    const struct clock_time later = {.s = 1.0, .rest = 3e-17};
    const struct clock_time earlier = {.s = 1.0, .rest = -2e-17};
    TEST_ASSERT_DOUBLE_WITHIN(1e-30, 5e-17, clock_difference(later, earlier));
    TEST_ASSERT_DOUBLE_WITHIN(1e-30, -5e-17, clock_difference(earlier, later));
}

/* ---- Polynomials -----------------------------------------------------------------------------
 * Those that move: test_stepping.c, fmi2/test_fmi2_polynomials.c. */

static void test_held_values_stay_bit_for_bit(void) {
    static const double values[POLYNOMIAL_NODES] = {0.1, 0.1, 0.1, 0.1};
    const struct polynomial held = {{0.1}};
    const struct polynomial shifted = polynomial_shifted(&held, 0.3);
    const struct polynomial through = polynomial_through(values, 0.3);
    TEST_ASSERT_EQUAL_DOUBLE(0.1, polynomial_value(&held, 1e6));
    TEST_ASSERT_EQUAL_MEMORY(&held, &shifted, sizeof held);
    TEST_ASSERT_EQUAL_MEMORY(&held, &through, sizeof held);
}
