/* Operations on Taylor coefficients, from which a model makes its series (model.h): the rows of
 * the series hold its states and, of each equation, the factors and intermediate results.
 *
 * A jet is the array of the coefficients of a quantity. Each function gives coefficient k of a
 * result. A sum, a difference or a multiple needs no function: take it of each coefficient.
 * Griewank and Walther, Evaluating Derivatives (2nd edition, SIAM 2008), section 13.2, have the
 * recurrences of quotients and functions. */
#pragma once

#include "model.h"

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
