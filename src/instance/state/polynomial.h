/* An input over a step: a Taylor polynomial of degree 3 from the beginning of the step. */
#ifndef POLYNOMIAL_H
#define POLYNOMIAL_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>

enum { POLYNOMIAL_DEGREE = 3 };

/* d[k]: the k-th derivative at the origin, in the unit of the input over s^k. */
struct polynomial {
    double d[POLYNOMIAL_DEGREE + 1];
};

/* It is not constant. */
static inline bool polynomial_moves(const struct polynomial *polynomial) {
    const double *d = polynomial->d;
    return fabs(d[1]) + fabs(d[2]) + fabs(d[3]) != 0.0; // with one branch
}

/* One of them is not constant. */
static inline bool polynomials_move(const struct polynomial polynomials[], size_t count) {
    bool found = false;
    for (size_t i = 0; i < count; i++) {
        found |= polynomial_moves(&polynomials[i]);
    }
    return found;
}

/* Value at time t (s) after the origin. */
double polynomial_value(const struct polynomial *polynomial, double t);

/* The polynomial with values[k] at k h / (POLYNOMIAL_NODES - 1), h > 0 (s). With equal values, all
 * its derivatives are 0. */
enum { POLYNOMIAL_NODES = POLYNOMIAL_DEGREE + 1 };
struct polynomial polynomial_through(const double values[POLYNOMIAL_NODES], double h);

/* The same polynomial with its origin moved by t (s). */
struct polynomial polynomial_shifted(const struct polynomial *polynomial, double t);

#endif
