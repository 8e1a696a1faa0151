/* Polynomials through values of functions that are known. */
#include "roots.h"

#include <float.h>
#include <math.h>
#include <unity.h>

static const int counts[] = {3, 5, 9, 17};
static double c[CHEBYSHEV_LENGTH];

static double interpolate(int count, double (*function)(double)) {
    double values[CHEBYSHEV_LENGTH];
    for (int k = 0; k < count; k++) {
        values[k] = function(chebyshev_point(count, k));
    }
    return chebyshev_interpolate(count, values, c);
}

static double value(int count, double s) {
    double sum = 0.0;
    for (int k = count - 1; k >= 0; k--) {
        sum = sum * s + c[k];
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
            const double tail = chebyshev_interpolate(count, values, c);
            // powers of s in Chebyshev polynomials reach 6^degree
            const double rounding = DBL_EPSILON * pow(6.0, power);
            for (int k = 0; k < count; k++) {
                TEST_ASSERT_DOUBLE_WITHIN(rounding, k == power ? 1.0 : 0.0, c[k]);
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

static void test_smooth_functions_are_met_to_rounding(void) {
    (void)interpolate(17, smooth);
    TEST_ASSERT_DOUBLE_WITHIN(64.0 * DBL_EPSILON, 0.0, error(17, smooth));
    (void)interpolate(17, large);
    TEST_ASSERT_DOUBLE_WITHIN(2e6 * DBL_EPSILON, 0.0, error(17, large));
}

/* Noise in the last Chebyshev coefficients would be 10^12 times as much in powers of s. */
static void test_rounding_of_the_values_is_left_out(void) {
    (void)interpolate(17, large);
    for (int k = 9; k < 17; k++) {
        TEST_ASSERT_TRUE(c[k] == 0.0);
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1.0, c[1]);
}

static void test_the_first_value_and_constants_are_exact(void) {
    for (int i = 0; i < 4; i++) {
        (void)interpolate(counts[i], slow);
        TEST_ASSERT_TRUE(c[0] == slow(0.0));
        TEST_ASSERT_TRUE(interpolate(counts[i], constant) == 0.0);
        TEST_ASSERT_TRUE(c[0] == -0.1);
        for (int k = 1; k < counts[i]; k++) {
            TEST_ASSERT_TRUE(c[k] == 0.0);
        }
    }
}
