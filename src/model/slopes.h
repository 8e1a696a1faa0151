/* Derivatives for models that are made from their equations (fmu/compiler), where the plain rules
 * give 0 infinity or 0 / 0 although the derivative is finite. Elsewhere they give the same bits as
 * the plain rules. */
#pragma once

#include <math.h>

/* Returns the root of x^2 + y^2, scaled where squares would overflow or vanish. */
static inline double slopes_hypot(double x, double y) {
    const double largest = fmax(fabs(x), fabs(y));
    const double scale = largest > 0x1p500 ? 0x1p600 : largest < 0x1p-500 ? 0x1p-600 : 1.0;
    const double a = x / scale;
    const double b = y / scale;
    return sqrt(a * a + b * b) * scale;
}

/* Returns the derivative of f(x) from f'(x) and the derivative d of x. If x does not move, f(x)
 * does not move either, however steep it is. */
static inline double slopes_scaled(double slope, double d) {
    return d == 0.0 ? 0.0 : slope * d;
}

/* Returns the part a b' of the derivative of a b. An infinite product stays infinite. If a is 0 and
 * has a derivative, the derivative is a' b whatever b' is: a b is about a' b s a small way s ahead.
 */
static inline double slopes_product(double a, double of_b, double of_a) {
    if (of_b == 0.0 || isinf(a) || (a == 0.0 && isinf(of_b) && isfinite(of_a))) {
        return 0.0;
    }
    return a * of_b;
}

/* Returns the product of two derivatives, 0 if one of them is 0. */
static inline double slopes_both(double a, double b) {
    return a == 0.0 || b == 0.0 ? 0.0 : a * b;
}

/* Returns the derivative of a / b, from its product with b. */
static inline double slopes_over(double product, double b) {
    return product == 0.0 ? 0.0 : product / b;
}

/* Returns the derivative of a function that grows without end, 0 where it has overflowed. */
static inline double slopes_bounded(double slope) {
    return isinf(slope) ? 0.0 : slope;
}

/* Returns x to the power exponent - 1, from p = x to the power exponent, whose derivative is
 * exponent times this, also if that is 0. */
static inline double slopes_reduced(double p, double x, double exponent) {
    if (x != 0.0) {
        return isinf(p) ? 0.0 : p / x;
    }
    return exponent == 0.0 ? 0.0 : pow(x, exponent - 1.0);
}

/* Returns p log(x), the derivative by the exponent, from p = x to the power exponent. */
static inline double slopes_logged(double p, double x, double exponent) {
    return (x == 0.0 && exponent > 0.0) || (x != 0.0 && isinf(p)) ? 0.0 : p * log(x);
}

/* Returns coefficient k > 0 of y = (factor x) to the power exponent, if x is 0 at first, from lower
 * orders of y and the coefficients x, which are `stride` apart. If y has no such series, returns 0
 * as for a constant y: a step that is short enough is right nevertheless. */
static inline double slopes_power(const double x[], double factor, double exponent, int k,
                                  const double y[], int stride) {
    int first = 1;
    while (first <= k && x[first * stride] == 0.0) {
        first++;
    }
    // x is s^first times a series that begins with a number other than 0
    const double begin = first * exponent;
    if (y[0] != 0.0 || first > k || exponent < 1.0 || begin != floor(begin) || k < begin) {
        return 0.0;
    }
    const double x_first = factor * x[first * stride];
    const int count = k - (int)begin;
    if (count == 0) {
        return pow(x_first, exponent);
    }
    double sum = 0.0;
    for (int i = 1; i <= count; i++) {
        sum +=
            (i * exponent - (count - i)) * (factor * x[(first + i) * stride]) * y[(k - i) * stride];
    }
    return sum / (count * x_first);
}
