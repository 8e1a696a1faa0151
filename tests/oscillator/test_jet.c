/* Operations on Taylor coefficients against closed forms, in all orders.
 *
 * Bounds count epsilons of the sum of the absolute terms. An error of a quotient or a root is one
 * of x, divided by y or 2 z: its bound is the product of three majorants. */
#include "jet.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <unity.h>

#define EPS DBL_EPSILON

typedef double jet[SERIES_LENGTH];

static void assert_close(double expected, double actual, double bound, int k) {
    char message[32];
    snprintf(message, sizeof message, "order %d", k);
    TEST_ASSERT_TRUE_MESSAGE(fabs(actual - expected) <= bound, message);
}

/* exp(rate t) */
static void exponential(double rate, jet x) {
    x[0] = 1.0;
    for (int k = 1; k < SERIES_LENGTH; k++) {
        x[k] = x[k - 1] * rate / k;
    }
}

/* 1 / k! */
static double reciprocal_factorial(int k) {
    double value = 1.0;
    for (int i = 2; i <= k; i++) {
        value /= i;
    }
    return value;
}

static void test_product_of_exponentials(void) {
    jet x, y, expected;
    exponential(0.75, x);
    exponential(1.5, y);
    exponential(2.25, expected);
    for (int k = 0; k < SERIES_LENGTH; k++) {
        assert_close(expected[k], jet_product(x, y, k), 4 * k * EPS * expected[k], k);
    }
}

static void test_square_is_the_product_with_itself(void) {
    jet x, expected;
    exponential(0.75, x);
    exponential(1.5, expected);
    for (int k = 0; k < SERIES_LENGTH; k++) {
        assert_close(expected[k], jet_square(x, k), 4 * k * EPS * expected[k], k);
    }
}

/* exp(-t) sin t is the imaginary part of exp((i - 1) t), and (i - 1)^k has integer parts. */
static void test_product_and_quotient_of_sine_and_exponential(void) {
    const jet t = {[1] = 1.0};
    jet s, c, falling, rising, quotient;
    exponential(-1.0, falling);
    exponential(1.0, rising);
    double real = 1.0;
    double imaginary = 0.0;
    for (int k = 0; k < SERIES_LENGTH; k++) {
        jet_sine_cosine(t, s, c, k);
        quotient[k] = jet_quotient(s, rising, quotient, k);
        const double expected = imaginary * reciprocal_factorial(k);
        const double factors = ldexp(reciprocal_factorial(k), k);                  // exp(2 t)
        const double division = pow(2.0 + sqrt(2.0), k) * reciprocal_factorial(k); // z y / y
        assert_close(expected, jet_product(s, falling, k), 4 * (k + 1) * EPS * factors, k);
        assert_close(expected, quotient[k], 4 * (k + 1) * EPS * division, k);
        const double next = -real - imaginary;
        imaginary = real - imaginary;
        real = next;
    }
}

static void test_geometric_series(void) {
    const jet one = {1.0};
    const jet difference = {1.0, -1.0};
    jet z;
    for (int k = 0; k < SERIES_LENGTH; k++) {
        z[k] = jet_quotient(one, difference, z, k);
        TEST_ASSERT_TRUE(z[k] == 1.0);
    }
}

static void test_quotient_undoes_the_product(void) {
    jet x, y, product, quotient;
    exponential(1.25, x);
    exponential(-0.5, y);
    for (int k = 0; k < SERIES_LENGTH; k++) {
        y[k] *= 3.0;
        product[k] = jet_product(x, y, k);
        quotient[k] = jet_quotient(product, y, quotient, k);
        const double terms = pow(1.25 + 0.5 + 0.5, k) * reciprocal_factorial(k);
        assert_close(x[k], quotient[k], 4 * (k + 1) * EPS * terms, k);
    }
}

/* sin(x + w t) = sum of sin(x + k pi / 2) (w t)^k / k! */
static void test_sine_and_cosine_along_a_line(void) {
    const double w = 1.5;
    const jet x = {0.7, w};
    const double turn[4] = {sin(0.7), cos(0.7), -sin(0.7), -cos(0.7)};
    jet s, c;
    for (int k = 0; k < SERIES_LENGTH; k++) {
        jet_sine_cosine(x, s, c, k);
        const double scale = pow(w, k) * reciprocal_factorial(k);
        assert_close(turn[k % 4] * scale, s[k], 4 * (k + 1) * EPS * scale, k);
        assert_close(turn[(k + 1) % 4] * scale, c[k], 4 * (k + 1) * EPS * scale, k);
    }
}

/* sin(t^2) = t^2 - t^6 / 3! + ...; the terms that are missing are exactly zero. */
static void test_sine_and_cosine_of_a_square(void) {
    const jet x = {[2] = 1.0};
    jet s, c;
    for (int k = 0; k < SERIES_LENGTH; k++) {
        jet_sine_cosine(x, s, c, k);
        const double size = k % 2 == 0 ? reciprocal_factorial(k / 2) : 0.0;
        const double sine = k % 4 == 2 ? size : 0.0;
        const double cosine = k % 4 == 0 ? size : 0.0;
        const double sign = k % 8 < 4 ? 1.0 : -1.0;
        assert_close(sign * sine, s[k], 4 * k * EPS * sine, k);
        assert_close(sign * cosine, c[k], 4 * k * EPS * cosine, k);
    }
}

/* The square root of 1 - t: coefficient k is that before by (k - 3/2) / k. */
static void test_square_root_by_the_binomial_series(void) {
    const jet x = {1.0, -1.0};
    jet z;
    double expected = 1.0;
    for (int k = 0; k < SERIES_LENGTH; k++) {
        z[k] = jet_square_root(x, z, k);
        assert_close(expected, z[k], 4 * k * EPS * fabs(expected), k);
        expected *= (k - 0.5) / (k + 1);
    }
}

static void test_square_root_of_an_exponential(void) {
    jet x, expected, z;
    exponential(2.5, x);
    exponential(1.25, expected);
    for (int k = 0; k < SERIES_LENGTH; k++) {
        z[k] = jet_square_root(x, z, k);
        const double terms = pow(1.25 + 1.25 + 1.25, k) * reciprocal_factorial(k);
        assert_close(expected[k], z[k], 4 * k * EPS * terms, k);
    }
}

/* atan t = t - t^3 / 3 + t^5 / 5 - ...; its sine is t / sqrt(1 + t^2). */
static void test_atan2_and_the_sine_of_it(void) {
    const jet one = {1.0};
    const jet t = {[1] = 1.0};
    const jet r2 = {[0] = 1.0, [2] = 1.0};
    jet angle, s, c, r, sine, cosine;
    for (int k = 0; k < SERIES_LENGTH; k++) {
        angle[k] = jet_atan2(t, one, r2, angle, k);
        const double expected = k % 2 == 0 ? 0.0 : (k % 4 == 1 ? 1.0 : -1.0) / k;
        assert_close(expected, angle[k], 4 * EPS * fabs(expected), k);

        jet_sine_cosine(angle, s, c, k);
        r[k] = jet_square_root(r2, r, k);
        sine[k] = jet_quotient(t, r, sine, k);
        cosine[k] = jet_quotient(one, r, cosine, k);
        assert_close(sine[k], s[k], 4 * k * EPS, k);
        assert_close(cosine[k], c[k], 4 * k * EPS, k);
    }
}

/* Along x = r cos z, y = r sin z the angle is z. */
static void test_atan2_undoes_sine_and_cosine(void) {
    const jet z = {2.5, -0.75, 0.5, 0.25};
    jet s, c, r, x, y, r2, angle;
    exponential(0.5, r);
    for (int k = 0; k < SERIES_LENGTH; k++) {
        jet_sine_cosine(z, s, c, k);
        x[k] = jet_product(r, c, k);
        y[k] = jet_product(r, s, k);
        r2[k] = jet_square(x, k) + jet_square(y, k);
        angle[k] = jet_atan2(y, x, r2, angle, k);
        assert_close(z[k], angle[k], 8 * (k + 1) * EPS, k);
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
