/* Falls of an indicator: a later one need not be located where an event comes before it. */
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
        const double s = fall_first(&p, &(struct fall){.latest = INFINITY,
                                                       .is_restart = true,
                                                       .is_armed = &is_armed,
                                                       .noise = &noise});
        const bool is_close = s <= 1.0 && i % 5 == 0;
        const double latest = is_close ? s * (1.0 + 1e-15 * chance()) : fabs(chance());
        const double found = fall_first(&p, &(struct fall){.latest = latest,
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

/* p = -s (1 - 4 s) (1 - s / 0.9) / 10: the first fall counts only because p has been above the
 * noise before, between 0.4 and 0.9. */
static void test_an_indicator_that_rises_above_its_noise_is_armed(void) {
    const double c[ROOTS_LENGTH] = {0.0, -0.1, 0.4 + 0.1 / 0.9, -0.4 / 0.9};
    bool is_armed = false;
    double noise = 0.02;
    const double s = fall_first(
        &(struct roots_polynomial){c, 3, -1.0},
        &(struct fall){
            .latest = INFINITY, .is_restart = true, .is_armed = &is_armed, .noise = &noise});
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 0.9, s);
    TEST_ASSERT_TRUE(is_armed);
}

/* p = (s - 0.5)^2 - 1e-6 */
static void test_a_dip_within_the_touch_is_no_fall(void) {
    const double c[ROOTS_LENGTH] = {0.25 - 1e-6, -1.0, 1.0};
    for (int k = 0; k < 2; k++) {
        bool is_armed = true;
        double noise = 0.0;
        const double s = fall_first(&(struct roots_polynomial){c, 2, -1.0},
                                    &(struct fall){.touch = k == 0 ? 1e-7 : 1e-5,
                                                   .latest = INFINITY,
                                                   .is_armed = &is_armed,
                                                   .noise = &noise});
        TEST_ASSERT_TRUE(k == 0 ? fabs(s - 0.499) < 1e-12 : s == INFINITY);
    }
}
