/* Values and roots of polynomials whose factors or values are known, and polynomials through values
 * of functions that are known. Random polynomials: test_random_roots.py. */
#include "roots.h"

#include <float.h>
#include <math.h>
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

/* ---- Changes of sign ------------------------------------------------------------------------ */

/* Values near the roots need twice the digits. */
static void test_units_do_not_matter(void) {
    struct root expected[ROOTS_LENGTH];
    double c[ROOTS_LENGTH] = {1.0};
    int degree = 0;
    for (int i = 1; i <= 7; i++) {
        degree = multiply(c, degree, i / 7.3);
    }
    TEST_ASSERT_EQUAL_INT(7, find(c, degree));
    memcpy(expected, roots, sizeof roots);
    for (int exponent = -1000; exponent <= 1000; exponent += 100) {
        double scaled[ROOTS_LENGTH];
        for (int k = 0; k <= degree; k++) {
            scaled[k] = ldexp(-c[k], exponent);
        }
        TEST_ASSERT_TRUE(first(scaled, degree, 0.0) == expected[0].s);
        TEST_ASSERT_EQUAL_INT(7, find(scaled, degree));
        for (int i = 0; i < 7; i++) {
            assert_root(expected[i].s, i % 2 == 0 ? ROOT_FALLS : ROOT_RISES, &roots[i]);
        }
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

/* ---- Ends ----------------------------------------------------------------------------------- */

static void test_a_root_beyond_the_end_by_rounding_is_a_touch(void) {
    const double beyond_by_rounding[] = {1.0, -0.5, -0.5 + 0x1p-53};
    TEST_ASSERT_EQUAL_INT(1, find(beyond_by_rounding, 2));
    assert_root(1.0, ROOT_TOUCHES, &roots[0]);
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
    const double falls_at[] = {0.0, -1.0, 3.0};
    const struct roots_polynomial p = {falls_at, 2, -1.0};
    TEST_ASSERT_EQUAL_INT(1, roots_find(&p, roots));
    TEST_ASSERT_EQUAL_INT(ROOT_RISES, roots[0].kind);
    const double constant[] = {-2.0};
    TEST_ASSERT_TRUE(first(constant, 0, 0.0) == 0.0);
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

/* ---- Values --------------------------------------------------------------------------------- */

enum { MOST = 20 };

/* Coefficients of (1 - 2 s)^degree: integers that doubles hold. */
static void power(int degree, double c[]) {
    c[0] = 1.0;
    for (int k = 1; k <= degree; k++) {
        c[k] = -2.0 * c[k - 1] * (degree - k + 1) / k;
    }
}

static double power_at(int degree, double s) {
    double value = 1.0;
    for (int k = 0; k < degree; k++) {
        value *= 1.0 - 2.0 * s;
    }
    return value;
}

static double size_at(const double c[], int degree, double s) {
    double size = 0.0;
    for (int k = degree; k >= 0; k--) {
        size = size * s + fabs(c[k]);
    }
    return size;
}

static void test_value_and_slope(void) {
    const double c[] = {3.0, -2.0, 0.5, 4.0};
    const struct horner_value at = horner(c, 3, 0.5);
    TEST_ASSERT_EQUAL_DOUBLE(2.625, at.value);
    TEST_ASSERT_EQUAL_DOUBLE(1.5, at.slope);
    TEST_ASSERT_EQUAL_DOUBLE(10 * 0x1p-53 * 4.625, at.rounding);
}

/* Also the error of rounded coefficients; the bound is not much larger. */
static void test_rounding_bounds_the_error(void) {
    for (int degree = 1; degree <= MOST; degree++) {
        double c[MOST + 1];
        double rounded[MOST + 1];
        double largest = 0.0;
        power(degree, c);
        for (int i = 0; i <= 1000; i++) {
            const double s = i / 1000.0;
            for (int k = 0; k <= degree; k++) {
                rounded[k] = c[k] * (1.0 + ((i + k) % 2 == 0 ? DBL_EPSILON : 0.0));
            }
            const struct horner_value exact = horner(c, degree, s);
            const struct horner_value about = horner(rounded, degree, s);
            const double value = power_at(degree, s);
            TEST_ASSERT_TRUE(fabs(exact.value - value) <= exact.rounding);
            TEST_ASSERT_TRUE(fabs(about.value - value) <= 2.0 * about.rounding);
            largest = fmax(largest, fabs(exact.value - value) / exact.rounding);
        }
        TEST_ASSERT_TRUE(degree < 3 || largest > 0.01);
    }
}

static void test_compensated_values_have_all_digits(void) {
    for (int degree = 1; degree <= MOST; degree++) {
        double c[MOST + 1];
        int known = 0;
        power(degree, c);
        for (int i = 0; i <= 1000; i++) {
            const double s = i / 1000.0;
            const double exact = power_at(degree, s);
            const double value = horner_compensated(c, degree, s);
            const double unknown = 0x1p-94 * size_at(c, degree, s);
            TEST_ASSERT_DOUBLE_WITHIN(2.0 * unknown + (degree + 2) * DBL_EPSILON * fabs(exact),
                                      exact, value);
            known += value != 0.0;
        }
        TEST_ASSERT_TRUE(known >= 800);
    }
}

static void test_compensated_values_below_their_error_are_0(void) {
    double c[MOST + 1];
    power(MOST, c);
    TEST_ASSERT_TRUE(horner_compensated(c, MOST, 0.5) == 0.0);
    TEST_ASSERT_TRUE(horner_compensated(c, MOST, 0.5 + 0x1p-6) == 0.0);
    TEST_ASSERT_TRUE(horner_compensated(c, MOST, 0.5 + 0x1p-4) > 0.0);
}

/* ---- Interpolation -------------------------------------------------------------------------- */

static const int counts[] = {3, 5, 9, 17};
static double through[CHEBYSHEV_LENGTH];

static double interpolate(int count, double (*function)(double)) {
    double values[CHEBYSHEV_LENGTH];
    for (int k = 0; k < count; k++) {
        values[k] = function(chebyshev_point(count, k));
    }
    return chebyshev_interpolate(count, values, through);
}

static double value(int count, double s) {
    double sum = 0.0;
    for (int k = count - 1; k >= 0; k--) {
        sum = sum * s + through[k];
    }
    return sum;
}

/* The largest difference on [0, 1]. */
static double error(int count, double (*function)(double)) {
    double largest = 0.0;
    for (int i = 0; i <= 1000; i++) {
        const double s = i / 1000.0;
        largest = fmax(largest, fabs(value(count, s) - function(s)));
    }
    return largest;
}

static void test_points(void) {
    const long double pi = 3.14159265358979323846264338327950288L;
    for (int i = 0; i < 4; i++) {
        const int count = counts[i];
        for (int k = 0; k < count; k++) {
            const long double chord = sinl(k * pi / (2 * (count - 1)));
            TEST_ASSERT_DOUBLE_WITHIN(DBL_EPSILON / 2.0, (double)(chord * chord),
                                      chebyshev_point(count, k));
            if (i > 0 && k % 2 == 0) {
                TEST_ASSERT_TRUE(chebyshev_point(count, k) ==
                                 chebyshev_point(counts[i - 1], k / 2));
            }
        }
        TEST_ASSERT_TRUE(chebyshev_point(count, 0) == 0.0);
        TEST_ASSERT_TRUE(chebyshev_point(count, count - 1) == 1.0);
    }
}

/* s^power is met by more points than power, with its coefficients. */
static void test_powers(void) {
    for (int i = 0; i < 4; i++) {
        const int count = counts[i];
        for (int power = 0; power < count; power++) {
            double values[CHEBYSHEV_LENGTH];
            for (int k = 0; k < count; k++) {
                values[k] = pow(chebyshev_point(count, k), power);
            }
            const double tail = chebyshev_interpolate(count, values, through);
            // powers of s in Chebyshev polynomials reach 6^degree
            const double rounding = DBL_EPSILON * pow(6.0, power);
            for (int k = 0; k < count; k++) {
                TEST_ASSERT_DOUBLE_WITHIN(rounding, k == power ? 1.0 : 0.0, through[k]);
            }
            if (power < count - 2) {
                TEST_ASSERT_DOUBLE_WITHIN(4.0 * DBL_EPSILON, 0.0, tail);
            }
            if (power == count - 1) {
                TEST_ASSERT_DOUBLE_WITHIN(1e-14, count == 3 ? 0.5 : pow(0.25, power) * power * 4.0,
                                          tail);
            }
        }
    }
}

static double smooth(double s) {
    return exp(-1.3 * s) * cos(4.0 * s);
}

static double slow(double s) {
    return 1.0 / (1.0 + 9.0 * (s - 0.4) * (s - 0.4));
}

static double rough(double s) {
    return fabs(s - 0.3);
}

static double large(double s) {
    return 1e6 + sin(s);
}

static double even(double s) {
    return cosh(3.0 * (s - 0.5));
}

static double odd(double s) {
    return sinh(3.0 * (s - 0.5));
}

static double constant(double s) {
    return -0.1;
}

/* The tail is no less than about the error, and no more than 100 times it. */
static void test_tail(void) {
    double (*const functions[])(double) = {smooth, slow, even, odd, rough};
    const double least[] = {0.5, 0.5, 0.5, 0.5, 0.1};
    for (int f = 0; f < 5; f++) {
        for (int i = 0; i < 4; i++) {
            const double tail = interpolate(counts[i], functions[f]);
            const double difference = error(counts[i], functions[f]);
            TEST_ASSERT_TRUE(tail + 1e-14 >= least[f] * difference);
            TEST_ASSERT_TRUE(tail <= 100.0 * difference);
        }
    }
}

/* Noise in the last Chebyshev coefficients would be 10^12 times as much in powers of s. */
static void test_rounding_of_the_values_is_left_out(void) {
    (void)interpolate(17, large);
    for (int k = 9; k < 17; k++) {
        TEST_ASSERT_TRUE(through[k] == 0.0);
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1.0, through[1]);
}

static void test_the_first_value_and_constants_are_exact(void) {
    for (int i = 0; i < 4; i++) {
        (void)interpolate(counts[i], slow);
        TEST_ASSERT_TRUE(through[0] == slow(0.0));
        TEST_ASSERT_TRUE(interpolate(counts[i], constant) == 0.0);
        TEST_ASSERT_TRUE(through[0] == -0.1);
        for (int k = 1; k < counts[i]; k++) {
            TEST_ASSERT_TRUE(through[k] == 0.0);
        }
    }
}
