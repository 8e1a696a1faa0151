/* Operations on Taylor coefficients against closed forms, in all orders. */
#include "jet.h"

#include <float.h>
#include <math.h>
#include <unity.h>

typedef double jet[SERIES_LENGTH];

/* exp(rate t) */
static void exponential(double rate, jet x) {
    x[0] = 1.0;
    for (int k = 1; k < SERIES_LENGTH; k++) {
        x[k] = x[k - 1] * rate / k;
    }
}

static void test_product_of_exponentials(void) {
    jet x, y, expected;
    exponential(0.75, x);
    exponential(1.5, y);
    exponential(2.25, expected);
    for (int k = 0; k < SERIES_LENGTH; k++) {
        const double bound = 4 * k * DBL_EPSILON * expected[k];
        TEST_ASSERT_TRUE(fabs(jet_product(x, y, k) - expected[k]) <= bound);
    }
}

static void test_integral_and_input(void) {
    const jet dx = {3.0, 5.0, 7.0};
    TEST_ASSERT_TRUE(jet_integral(dx, 0.5, 1) == 1.5);
    TEST_ASSERT_TRUE(jet_integral(dx, 0.5, 2) == 1.25);

    const double inputs[2][SERIES_INPUT_LENGTH] = {{1.0, 2.0, 3.0, 4.0}, {5.0, 6.0, 7.0, 8.0}};
    const struct series_origin origin = {.time_scale = 1.0, .inputs = inputs};
    TEST_ASSERT_TRUE(jet_input(&origin, 0, 3) == 4.0 && jet_input(&origin, 1, 0) == 5.0);
    TEST_ASSERT_TRUE(jet_input(&origin, 0, 4) == 0.0 && jet_input(&origin, 1, 31) == 0.0);
}
