/* Values of polynomials whose factors are known. */
#include "roots.h"

#include <float.h>
#include <unity.h>

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

/* Also that of coefficients that have been rounded; and it is not much larger than the error. */
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
