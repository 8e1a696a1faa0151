/* The first roots of polynomials, and the proof that there is none. */
#include "roots.h"

#include <float.h>
#include <stdint.h>
#include <string.h>
#include <unity.h>

static double first(const double c[], int degree) {
    const struct roots_polynomial p = {c, degree, 0.0};
    return roots_first(&p);
}

/* ---- None ----------------------------------------------------------------------------------- */

/* The proof holds for what is well above 0, and for nothing that reaches it. */
static void test_quick_proof(void) {
    uint64_t state = 1;
    int proven = 0;
    for (int i = 0; i < 200000; i++) {
        double c[ROOTS_LENGTH] = {0.0};
        const int degree = i % ROOTS_LENGTH;
        double size = 1.0;
        for (int k = 0; k <= degree; k++) {
            state = state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
            c[k] = size * ((double)(state >> 11) * 0x1p-52 - 1.0);
            size *= i % 3 == 0 ? 1.0 : 0.5;
        }
        c[0] = i % 5 == 0 ? 0.0 : fabs(c[0]);
        const struct roots_polynomial p = {c, degree, 0.0};
        if (roots_is_above(&p)) {
            TEST_ASSERT_TRUE(roots_search_first(&p) == INFINITY);
            proven++;
        } else if (degree >= 2 && c[0] > 0.0) {
            double least = c[0];
            for (int k = 1; k <= degree; k++) {
                least -= fabs(c[k]);
            }
            TEST_ASSERT_TRUE(least < 1e-12);
        }
    }
    TEST_ASSERT_TRUE(proven > 60000);
}

/* c0 + c1 s + d s^2 is 0 at one end, or at its lowest point; a little above, that is proven. */
static void test_limits_of_the_quick_proof(void) {
    const double at_limit[][5] = {
        {1.0, -0.5, -0.25, 0.5, -0.25}, {1.0, 0.5, 0.5, -1.0, -1.0},
        {0.25, -1.0, 1.0, 7.0, 0.0},    {0.0, 1.0, -0.5, -0.5, 0.25},
        {1.0, -2.0, 1.0, 0.0, 3.0},     {0.25, -1.0, 2.0, -1.0, 1.0},
        {1.0, -1.5, 0.5, 0.0, 0.0},     {0.0, 0.25, -1.0, 1.25, -0.25},
    };
    for (size_t i = 0; i < sizeof at_limit / sizeof at_limit[0]; i++) {
        double c[5];
        memcpy(c, at_limit[i], sizeof c);
        const struct roots_polynomial p = {c, 4, 0.0};
        double *const lowest = c[0] == 0.0 ? &c[1] : &c[0];
        TEST_ASSERT_FALSE(roots_is_above(&p));
        *lowest += 1e-15;
        TEST_ASSERT_FALSE(roots_is_above(&p));
        *lowest += 1e-12;
        TEST_ASSERT_TRUE(roots_is_above(&p));
        const struct roots_polynomial in_noise = {c, 4, 2.0};
        TEST_ASSERT_FALSE(roots_is_above(&in_noise));
    }
}

/* ---- Several -------------------------------------------------------------------------------- */

static void test_earliest_of_several(void) {
    const double late[] = {0.75, -1.0, 0.0};
    const double early[] = {0.5, -1.0, 0.0};
    const double never[] = {1.0, 0.5, 0.25};
    const double same[] = {1.0, -1.0, -2.0};
    const double touching[] = {0.25, -1.0, 1.0};
    const struct roots_polynomial p[] = {
        {late, 2, 0.0}, {early, 2, 0.0}, {never, 2, 0.0}, {same, 2, 0.0}, {touching, 2, 0.0},
    };
    bool is_at_root[5];
    TEST_ASSERT_TRUE(roots_earliest(5, p, is_at_root) == 0.5);
    const bool expected[] = {false, true, false, true, true};
    TEST_ASSERT_EQUAL_MEMORY(expected, is_at_root, sizeof expected);
    TEST_ASSERT_TRUE(roots_earliest(1, p, is_at_root) == 0.75);
    TEST_ASSERT_TRUE(is_at_root[0]);
    TEST_ASSERT_TRUE(roots_earliest(1, p + 2, is_at_root) == INFINITY);
    TEST_ASSERT_FALSE(is_at_root[0]);
    TEST_ASSERT_TRUE(roots_earliest(0, p, is_at_root) == INFINITY);
}

/* Their own roots differ in the last bits, or the other one has been dealt with. */
static void test_several_are_within_rounding_of_0(void) {
    const double third[] = {1.0, -3.0};
    const double third_beside[] = {nextafter(first(third, 1), 1.0), -1.0};
    const double beside[] = {1.0, -3.0 + 1e-14};
    const double bouncing[] = {0.0, 1.0, -0.5};
    const struct roots_polynomial p[] = {
        {beside, 1, 0.0}, {third, 1, 0.0}, {third_beside, 1, 0.0}, {bouncing, 2, 0.0}};
    bool is_at_root[4];
    TEST_ASSERT_TRUE(first(third_beside, 1) == third_beside[0]);
    TEST_ASSERT_DOUBLE_WITHIN(DBL_EPSILON, 1.0 / 3.0, roots_earliest(4, p, is_at_root));
    const bool expected[] = {false, true, true, false};
    TEST_ASSERT_EQUAL_MEMORY(expected, is_at_root, sizeof expected);
}

static void test_earliest_is_the_start(void) {
    const double below[] = {-1.0, 3.0, 0.0};
    const double above[] = {1e-30, 3.0, 0.0};
    const double at[] = {0.0, 3.0, 0.0};
    const double falling[] = {0.0, -1.0, 0.0};
    const double later[] = {0.5, -1.0, 0.0};
    const struct roots_polynomial p[] = {
        {later, 2, 0.0}, {below, 2, 0.0}, {above, 2, 0.0}, {at, 2, 0.0}, {falling, 2, 0.0}};
    bool is_at_root[5];
    TEST_ASSERT_TRUE(roots_earliest(5, p, is_at_root) == 0.0);
    const bool expected[] = {false, true, false, false, true};
    TEST_ASSERT_EQUAL_MEMORY(expected, is_at_root, sizeof expected);
}
