#include "clock.h"

#include <unity.h>

/* 2 - 3 t + 5 t^2 / 2 + 7 t^3 / 6, whose values at small integers are exact to rounding. */
static const struct polynomial cubic = {{2.0, -3.0, 5.0, 7.0}};

static void test_values_of_a_cubic(void) {
    TEST_ASSERT_EQUAL_DOUBLE(2.0, polynomial_value(&cubic, 0.0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 2.0 - 3.0 + 2.5 + 7.0 / 6.0, polynomial_value(&cubic, 1.0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, 2.0 + 6.0 + 10.0 - 56.0 / 6.0, polynomial_value(&cubic, -2.0));
}

static void test_a_held_value_stays_bit_for_bit(void) {
    const struct polynomial held = {{0.1}};
    TEST_ASSERT_EQUAL_DOUBLE(0.1, polynomial_value(&held, 1e6));
    const struct polynomial shifted = polynomial_shifted(&held, 0.3);
    TEST_ASSERT_EQUAL_MEMORY(&held, &shifted, sizeof held);
}

static void test_a_shifted_polynomial_is_the_same_function(void) {
    const struct polynomial shifted = polynomial_shifted(&cubic, 1.5);
    for (int i = -4; i <= 4; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, polynomial_value(&cubic, 1.5 + 0.25 * i),
                                  polynomial_value(&shifted, 0.25 * i));
    }
    TEST_ASSERT_EQUAL_DOUBLE(-3.0 + 5.0 * 1.5 + 3.5 * 2.25, shifted.d[1]);
    TEST_ASSERT_EQUAL_DOUBLE(5.0 + 7.0 * 1.5, shifted.d[2]);
    TEST_ASSERT_EQUAL_DOUBLE(7.0, shifted.d[3]);
}

static void test_a_polynomial_through_four_values(void) {
    double values[POLYNOMIAL_NODES];
    for (int k = 0; k < POLYNOMIAL_NODES; k++) {
        values[k] = polynomial_value(&cubic, 0.25 * k);
    }
    const struct polynomial through = polynomial_through(values, 0.75);
    for (int k = 0; k <= POLYNOMIAL_DEGREE; k++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, cubic.d[k], through.d[k]);
    }
    TEST_ASSERT_TRUE(values[0] == through.d[0]);
}

static void test_equal_values_are_held(void) {
    static const double values[POLYNOMIAL_NODES] = {0.1, 0.1, 0.1, 0.1};
    const struct polynomial held = {{0.1}};
    const struct polynomial through = polynomial_through(values, 0.3);
    TEST_ASSERT_EQUAL_MEMORY(&held, &through, sizeof held);
}
