/* Operations on Taylor coefficients, from which a model makes its series (model.h): the rows of
 * the series hold its states and, of each equation, the factors and intermediate results.
 *
 * A jet is the array of the coefficients of a quantity. Each function gives coefficient k of a
 * result from the coefficients up to k of its arguments and those below k of the result. A sum, a
 * difference or a multiple needs no function: it is that of the coefficients.
 *
 * The recurrences are those of Griewank and Walther, Evaluating Derivatives (2nd edition, SIAM
 * 2008), section 13.2. */
#pragma once

#include "model.h"

#include <math.h>

/* Of a quantity with the derivative dx by the time; k > 0:  x_k = (time_scale / k) dx_(k-1) */
static inline double jet_integral(const double dx[], double time_scale, int k) {
    return time_scale / k * dx[k - 1];
}

/* Of an input. */
static inline double jet_input(const struct series_origin *origin, int input, int k) {
    return k < SERIES_INPUT_LENGTH ? origin->inputs[input][k] : 0.0;
}

/* z = x y:  z_k = sum over i = 0 .. k of x_i y_(k-i) */
static inline double jet_product(const double x[], const double y[], int k) {
    double sum = 0.0;
    for (int i = 0; i <= k; i++) {
        sum += x[i] * y[k - i];
    }
    return sum;
}

/* z = x^2:  each product of two different coefficients stands twice in the sum. */
static inline double jet_square(const double x[], int k) {
    double sum = 0.0;
    for (int i = 0; 2 * i < k; i++) {
        sum += x[i] * x[k - i];
    }
    return 2.0 * sum + (k % 2 == 0 ? x[k / 2] * x[k / 2] : 0.0);
}

/* z = x / y, from x = z y:  z_k = (x_k - sum over i = 1 .. k of y_i z_(k-i)) / y_0 */
static inline double jet_quotient(const double x[], const double y[], const double z[], int k) {
    double rest = x[k];
    for (int i = 1; i <= k; i++) {
        rest -= y[i] * z[k - i];
    }
    return rest / y[0];
}

/* z = sqrt(x) with x_0 > 0, from x = z^2:
 * z_k = (x_k - sum over i = 1 .. k-1 of z_i z_(k-i)) / (2 z_0) */
static inline double jet_square_root(const double x[], const double z[], int k) {
    if (k == 0) {
        return sqrt(x[0]);
    }
    double rest = x[k];
    for (int i = 1; i < k; i++) {
        rest -= z[i] * z[k - i];
    }
    return rest / (2.0 * z[0]);
}

/* Writes s[k] and c[k] of s = sin x and c = cos x, from s' = c x' and c' = -s x':
 * k s_k = sum over i = 1 .. k of i x_i c_(k-i),  k c_k = -sum of i x_i s_(k-i) */
static inline void jet_sine_cosine(const double x[], double s[], double c[], int k) {
    if (k == 0) {
        s[0] = sin(x[0]);
        c[0] = cos(x[0]);
        return;
    }
    double s_sum = 0.0;
    double c_sum = 0.0;
    for (int i = 1; i <= k; i++) {
        s_sum += i * x[i] * c[k - i];
        c_sum -= i * x[i] * s[k - i];
    }
    s[k] = s_sum / k;
    c[k] = c_sum / k;
}

/* z = atan2(y, x) with r2 = x^2 + y^2 and r2_0 > 0, from r2 z' = x y' - y x':
 * k r2_0 z_k = sum over i = 1 .. k of i (x_(k-i) y_i - y_(k-i) x_i - r2_(k-i) z_i), the last of
 * these for i < k only */
static inline double jet_atan2(const double y[], const double x[], const double r2[],
                               const double z[], int k) {
    if (k == 0) {
        return atan2(y[0], x[0]);
    }
    double sum = 0.0;
    for (int i = 1; i <= k; i++) {
        const double known = i < k ? r2[k - i] * z[i] : 0.0;
        sum += i * (x[k - i] * y[i] - y[k - i] * x[i] - known);
    }
    return sum / (k * r2[0]);
}
