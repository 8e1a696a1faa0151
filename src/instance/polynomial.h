/* An input over a step: a Taylor polynomial of degree 3 from the beginning of the step. */
#ifndef POLYNOMIAL_H
#define POLYNOMIAL_H

enum { POLYNOMIAL_DEGREE = 3 };

/* d[k]: the k-th derivative at the origin, in the unit of the input over s^k. */
struct polynomial {
    double d[POLYNOMIAL_DEGREE + 1];
};

/* Value at time t (s) after the origin. */
double polynomial_value(const struct polynomial *polynomial, double t);

/* The same polynomial with its origin moved by t (s). */
struct polynomial polynomial_shifted(const struct polynomial *polynomial, double t);

#endif
