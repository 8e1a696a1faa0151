/* Derivatives of models that are made from their equations (fmu/equations), where the plain rules
 * give 0 infinity or 0 / 0 though the derivative is finite. Elsewhere these are the plain rules, to
 * the bit. */
#ifndef SLOPES_H
#define SLOPES_H

#include <math.h>

/* The derivative of f(x), from f'(x) and the derivative d of x: what does not move x does not move
 * f(x), however steep it is. */
static inline double slopes_scaled(double slope, double d) {
    return d == 0.0 ? 0.0 : slope * d;
}

/* The part a b' of the derivative of a b. An infinite product stays so. Where a is 0, the
 * derivative is a' b whatever b' is, if a has one: a b is about a' b s a small way s ahead. */
static inline double slopes_product(double a, double of_b, double of_a) {
    if (of_b == 0.0 || isinf(a) || (a == 0.0 && isinf(of_b) && isfinite(of_a))) {
        return 0.0;
    }
    return a * of_b;
}

/* The derivative of a / b, from its product with b. */
static inline double slopes_over(double product, double b) {
    return product == 0.0 ? 0.0 : product / b;
}

/* The derivative of a function that grows without end: where it has overflowed it stays so. */
static inline double slopes_bounded(double slope) {
    return isinf(slope) ? 0.0 : slope;
}

/* x to the power exponent - 1, from p = x to the power exponent: its derivative is exponent times
 * this, also where that is 0. */
static inline double slopes_reduced(double p, double x, double exponent) {
    if (x != 0.0) {
        return isinf(p) ? 0.0 : p / x;
    }
    return exponent == 0.0 ? 0.0 : pow(x, exponent - 1.0);
}

/* p log(x), from p = x to the power exponent: its derivative by the exponent. */
static inline double slopes_logged(double p, double x, double exponent) {
    return (x == 0.0 && exponent > 0.0) || (x != 0.0 && isinf(p)) ? 0.0 : p * log(x);
}

/* Coefficient k > 0 of y = x to the power exponent, where x is 0 at first. x: coefficients of x.
 * It follows from lower orders, times 1 / factor. Where y has no such series, it is constant: too
 * short a step will do. */
static inline double slopes_power(const double x[], double factor, double exponent, int k,
                                  const double y[]) {
    int first = 1;
    while (first <= k && x[first] == 0.0) {
        first++;
    }
    // x is s^first times a series that begins with a number above or below 0
    const double begin = first * exponent;
    if (y[0] != 0.0 || first > k || exponent < 1.0 || begin != floor(begin) || k < begin) {
        return 0.0;
    }
    const double x_first = factor * x[first];
    const int count = k - (int)begin;
    if (count == 0) {
        return pow(x_first, exponent);
    }
    double sum = 0.0;
    for (int i = 1; i <= count; i++) {
        sum += (i * exponent - (count - i)) * (factor * x[first + i]) * y[k - i];
    }
    return sum / (count * x_first);
}

#endif
