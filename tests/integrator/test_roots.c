/* Roots of polynomials whose factors or values are known. Random ones: test_random_roots.py. */
#include "roots.h"

#include <float.h>
#include <stdint.h>
#include <string.h>
#include <unity.h>

static struct root roots[ROOTS_LENGTH];

static int find(const double c[], int degree) {
    const struct roots_polynomial p = {c, degree, 0.0};
    return roots_find(&p, roots);
}

static double first(const double c[], int degree, double noise) {
    const struct roots_polynomial p = {c, degree, noise};
    return roots_first(&p);
}

static void assert_root(double s, enum root_kind kind, const struct root *root) {
    TEST_ASSERT_TRUE(root->s == s);
    TEST_ASSERT_EQUAL_INT(kind, root->kind);
}

/* c becomes c (s - root); returns the degree. */
static int multiply(double c[], int degree, double root) {
    c[degree + 1] = 0.0;
    for (int k = degree + 1; k > 0; k--) {
        c[k] = c[k - 1] - root * c[k];
    }
    c[0] *= -root;
    return degree + 1;
}

static double before(double s) {
    return nextafter(s, 0.0);
}

/* ---- Changes of sign ------------------------------------------------------------------------ */

static void test_linear_polynomials(void) {
    for (int i = 1; i <= 1000; i++) {
        const double c[] = {i, -1000.0};
        const double rising[] = {-i, 1000.0};
        const double s = i / 1000.0;
        TEST_ASSERT_EQUAL_INT(1, find(c, 1));
        TEST_ASSERT_DOUBLE_WITHIN(DBL_EPSILON * s, s, roots[0].s);
        // the first double at which p is 0 or below
        TEST_ASSERT_TRUE(i - 1000.0L * roots[0].s <= 0.0L);
        TEST_ASSERT_TRUE(i - 1000.0L * before(roots[0].s) > 0.0L);
        TEST_ASSERT_EQUAL_INT(ROOT_FALLS, roots[0].kind);
        TEST_ASSERT_TRUE(first(c, 1, 0.0) == roots[0].s);
        const double falls = roots[0].s;
        TEST_ASSERT_EQUAL_INT(1, find(rising, 1));
        assert_root(falls, ROOT_RISES, &roots[0]);
    }
}

/* All degrees with roots at 1/8 to 7/8, or some of them: the coefficients are exact. */
static void test_products_of_exact_factors(void) {
    for (unsigned set = 1; set < 1u << 7; set++) {
        double c[ROOTS_LENGTH] = {1.0};
        double expected[8];
        int degree = 0;
        for (int i = 1; i <= 7; i++) {
            if ((set >> (i - 1) & 1u) != 0u) {
                expected[degree] = i / 8.0;
                degree = multiply(c, degree, i / 8.0);
            }
        }
        TEST_ASSERT_EQUAL_INT(degree, find(c, degree));
        for (int i = 0; i < degree; i++) {
            const bool falls = (degree - i) % 2 == 0;
            assert_root(expected[i], falls ? ROOT_FALLS : ROOT_RISES, &roots[i]);
        }
        // with no root in (0, 1] and no coefficient 0 before the others, but many behind them
        c[degree + 1] = 0.0;
        c[degree + 2] = 0.0;
        TEST_ASSERT_EQUAL_INT(degree, find(c, degree + 2));
    }
}

/* T_n(1 - 2 s) is 0 at sin^2((2 k - 1) pi / (4 n)). Values of degree 20 lose 15 digits. */
static void test_chebyshev_polynomials(void) {
    const long double pi = 3.14159265358979323846264338327950288L;
    double before_last[ROOTS_LENGTH] = {1.0};
    double c[ROOTS_LENGTH] = {1.0, -2.0};
    for (int n = 2; n <= 20; n++) {
        double next[ROOTS_LENGTH] = {0.0};
        for (int k = 0; k <= n; k++) {
            next[k] = 2.0 * c[k] - (k > 0 ? 4.0 * c[k - 1] : 0.0) - before_last[k];
        }
        memcpy(before_last, c, sizeof c);
        memcpy(c, next, sizeof c);
        TEST_ASSERT_EQUAL_INT(n, find(c, n));
        for (int k = 1; k <= n; k++) {
            const long double root = sinl((2 * k - 1) * pi / (4 * n));
            const double s = (double)(root * root);
            TEST_ASSERT_DOUBLE_WITHIN(DBL_EPSILON * s, s, roots[k - 1].s);
            TEST_ASSERT_EQUAL_INT(k % 2 == 1 ? ROOT_FALLS : ROOT_RISES, roots[k - 1].kind);
        }
        TEST_ASSERT_TRUE(first(c, n, 0.0) == roots[0].s);
    }
}

/* 1e-300 to 1e300 of the same polynomial, and coefficients of which some are denormal. */
static void test_units_do_not_matter(void) {
    const double c[] = {0.3, -1.0, 0.9, -0.8, 0.5, 0.11};
    TEST_ASSERT_EQUAL_INT(2, find(c, 5));
    const double s = roots[0].s;
    const double second = roots[1].s;
    for (int exponent = -1000; exponent <= 1000; exponent += 100) {
        double scaled[6];
        for (int k = 0; k < 6; k++) {
            scaled[k] = ldexp(c[k], exponent);
        }
        TEST_ASSERT_EQUAL_INT(2, find(scaled, 5));
        TEST_ASSERT_TRUE(roots[0].s == s && roots[1].s == second);
        TEST_ASSERT_TRUE(first(scaled, 5, 0.0) == s);
    }
    const double tiny[] = {3e-320, -4e-320};
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0.75, first(tiny, 1, 0.0));
}

static void test_roots_near_the_start(void) {
    for (int i = 1; i < 300; i++) {
        const double s = pow(10.0, -i);
        const double linear[] = {s, -1.0, 0.25, 0.5};
        const double power[] = {s, 0.0, 0.0, 0.0, 0.0, -1.0};
        TEST_ASSERT_DOUBLE_WITHIN(fmax(s, DBL_EPSILON) * s, s, first(linear, 3, -1.0));
        TEST_ASSERT_DOUBLE_WITHIN(1e-13 * pow(s, 0.2), pow(s, 0.2), first(power, 5, -1.0));
    }
}

/* ---- Roots that are no changes of sign, or nearly none -------------------------------------- */

static void test_a_double_root_is_a_touch(void) {
    for (int i = 1; i < 64; i++) {
        const double s = i / 64.0;
        const double above[] = {s * s, -2.0 * s, 1.0};
        const double below[] = {-s * s, 2.0 * s, -1.0};
        TEST_ASSERT_EQUAL_INT(1, find(above, 2));
        assert_root(s, ROOT_TOUCHES, &roots[0]);
        TEST_ASSERT_TRUE(first(above, 2, 0.0) == s);
        TEST_ASSERT_EQUAL_INT(1, find(below, 2));
        assert_root(s, ROOT_TOUCHES, &roots[0]);
    }
}

/* (s - 1/2)^2 (s - 1/4) (s + 2), and with the factors twice and three times. */
static void test_multiple_roots_between_others(void) {
    for (int times = 1; times <= 3; times++) {
        double c[ROOTS_LENGTH] = {1.0};
        int degree = multiply(c, 0, -2.0);
        for (int i = 0; i < times; i++) {
            degree = multiply(c, degree, 0.5);
        }
        degree = multiply(c, degree, 0.25);
        TEST_ASSERT_EQUAL_INT(2, find(c, degree));
        assert_root(0.25, times % 2 == 1 ? ROOT_FALLS : ROOT_RISES, &roots[0]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5, roots[1].s);
        TEST_ASSERT_EQUAL_INT(times == 2 ? ROOT_TOUCHES : ROOT_RISES, roots[1].kind);
    }
}

/* (s - 1/2)^2 + gap, of which the coefficients are exact. */
static void test_near_double_roots(void) {
    const double rounding = 8 * 0x1p-53 * 1.0; // at s = 1/2
    for (int halvings = 2; halvings < 54; halvings++) {
        const double gap = ldexp(1.0, -halvings);
        const double above[] = {0.25 + gap, -1.0, 1.0};
        const double below[] = {0.25 - gap, -1.0, 1.0};
        const int touches = gap <= rounding ? 1 : 0;
        TEST_ASSERT_EQUAL_INT(touches, find(above, 2));
        TEST_ASSERT_TRUE((first(above, 2, 0.0) < INFINITY) == (touches == 1));
        if (touches == 1) {
            assert_root(0.5, ROOT_TOUCHES, &roots[0]);
        }
        if (gap < 0.25) {
            TEST_ASSERT_EQUAL_INT(2, find(below, 2));
            TEST_ASSERT_DOUBLE_WITHIN(DBL_EPSILON, 0.5 - sqrt(gap), roots[0].s);
            TEST_ASSERT_DOUBLE_WITHIN(DBL_EPSILON, 0.5 + sqrt(gap), roots[1].s);
            TEST_ASSERT_EQUAL_INT(ROOT_FALLS, roots[0].kind);
            TEST_ASSERT_EQUAL_INT(ROOT_RISES, roots[1].kind);
            TEST_ASSERT_TRUE(first(below, 2, 0.0) == roots[0].s);
        }
    }
}

/* A parabola that passes a stop by 1e-7 of a step's way, or by as much in front of it. */
static void test_grazing(void) {
    const double passes[] = {0.3 * 0.3 - 1e-7, -0.6, 1.0, 1e-9, -1e-11};
    const double misses[] = {0.3 * 0.3 + 1e-7, -0.6, 1.0, 1e-9, -1e-11};
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, 0.3 - sqrt(1e-7), first(passes, 4, 0.0));
    TEST_ASSERT_TRUE(first(misses, 4, 0.0) == INFINITY);
}

/* ---- Ends ----------------------------------------------------------------------------------- */

static void test_roots_at_the_end_and_beyond(void) {
    const double at_end[] = {1.0, -0.5, -0.5};
    TEST_ASSERT_EQUAL_INT(1, find(at_end, 2));
    assert_root(1.0, ROOT_FALLS, &roots[0]);
    const double rising[] = {-1.0, 0.5, 0.5};
    TEST_ASSERT_EQUAL_INT(1, find(rising, 2));
    assert_root(1.0, ROOT_RISES, &roots[0]);
    const double beyond_by_rounding[] = {1.0, -0.5, -0.5 + 0x1p-53};
    TEST_ASSERT_EQUAL_INT(1, find(beyond_by_rounding, 2));
    assert_root(1.0, ROOT_TOUCHES, &roots[0]);
    const double beyond[] = {1.0, -0.5, -0.5 + 0x1p-46};
    TEST_ASSERT_EQUAL_INT(0, find(beyond, 2));
    const double before_end[] = {1.0, -0.5, -0.5 - 0x1p-46};
    TEST_ASSERT_EQUAL_INT(1, find(before_end, 2));
    TEST_ASSERT_TRUE(roots[0].s < 1.0);
    // the last of three
    const double three[] = {-0.25, 1.375, -2.125, 1.0};
    TEST_ASSERT_EQUAL_INT(3, find(three, 3));
    TEST_ASSERT_EQUAL_INT(ROOT_FALLS, roots[1].kind);
    assert_root(1.0, ROOT_RISES, &roots[2]);
}

static void test_a_root_at_the_start_is_left_out(void) {
    // a ball that leaves the ground and comes back
    for (int i = 1; i < 40; i++) {
        const double s = ldexp(1.0, -i);
        const double c[] = {0.0, s, -1.0};
        TEST_ASSERT_TRUE(first(c, 2, 0.0) == s);
        TEST_ASSERT_EQUAL_INT(1, find(c, 2));
        assert_root(s, ROOT_FALLS, &roots[0]);
        const double above[] = {1e-17, s, -1.0};
        const double below[] = {-1e-17, s, -1.0};
        TEST_ASSERT_TRUE(first(above, 2, 1e-17) == s);
        TEST_ASSERT_TRUE(first(below, 2, 1e-17) == s);
    }
    // the speed at the start is within the noise, too
    const double slow[] = {1e-17, -1e-17, 1.0, -2.0};
    TEST_ASSERT_TRUE(first(slow, 3, 1e-17) == 0.5);
    const double leaving[] = {1e-17, -1e-17, 1.0, -0.5};
    TEST_ASSERT_TRUE(first(leaving, 3, 1e-17) == INFINITY);
    // coefficients behind the first that counts are no noise
    const double later[] = {0.0, 1e-5, -1e-12, 0.0, -1e-5};
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1.0, first(later, 4, 1e-8));
}

static void test_the_start_is_at_0_or_below(void) {
    const double at[] = {0.0, 1.0, -0.5};
    TEST_ASSERT_TRUE(first(at, 2, 0.0) == INFINITY);
    TEST_ASSERT_TRUE(first(at, 2, -1.0) == 0.0);
    TEST_ASSERT_EQUAL_INT(0, find(at, 2));
    const double below[] = {-1e-9, 1.0, 0.0};
    TEST_ASSERT_TRUE(first(below, 2, 0.0) == 0.0);
    TEST_ASSERT_TRUE(first(below, 2, 1e-9) == INFINITY);
    const double falling[] = {0.0, -1e-9, 1.0};
    TEST_ASSERT_TRUE(first(falling, 2, 0.0) == 0.0);
    TEST_ASSERT_EQUAL_INT(1, find(falling, 2));
    assert_root(1e-9, ROOT_RISES, &roots[0]);
}

/* ---- None ----------------------------------------------------------------------------------- */

static void test_polynomials_without_roots(void) {
    const double zeros[ROOTS_LENGTH] = {0.0};
    const double constant[] = {-2.0};
    const double noise[] = {1e-9, -1e-9, 1e-9};
    TEST_ASSERT_EQUAL_INT(0, find(zeros, ROOTS_LENGTH - 1));
    TEST_ASSERT_TRUE(first(zeros, 0, 0.0) == INFINITY);
    TEST_ASSERT_EQUAL_INT(0, find(constant, 0));
    TEST_ASSERT_TRUE(first(noise, 2, 1e-9) == INFINITY);
    const double wrong[] = {NAN, INFINITY, -INFINITY};
    for (int k = 0; k < 4; k++) {
        for (int i = 0; i < 3; i++) {
            double c[] = {1.0, -3.0, 2.0, -1.0};
            c[k] = wrong[i];
            TEST_ASSERT_EQUAL_INT(0, find(c, 3));
            TEST_ASSERT_TRUE(first(c, 3, 0.0) == INFINITY);
        }
    }
}

/* The proof holds for what is well above 0, and for nothing that reaches it. */
static void test_quick_proof(void) {
    uint64_t state = 1;
    int proven = 0;
    for (int i = 0; i < 200000; i++) {
        double c[ROOTS_LENGTH];
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
    const double seventh_of_sevens[] = {0.7, -2.1};
    const double beside[] = {1.0, -3.0 + 1e-14};
    const double bouncing[] = {0.0, 1.0, -0.5};
    const struct roots_polynomial p[] = {
        {beside, 1, 0.0}, {third, 1, 0.0}, {seventh_of_sevens, 1, 0.0}, {bouncing, 2, 0.0}};
    bool is_at_root[4];
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
