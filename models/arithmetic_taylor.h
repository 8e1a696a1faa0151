/* The arithmetic of equations (equation.h) with Taylor polynomials: derivatives along a curve. */
#ifndef ARITHMETIC_H
#define ARITHMETIC_H

#include "taylor.h"

typedef struct taylor real;

static inline real constant(double x) {
    return (real){.value = x};
}

static inline double value_of(real x) {
    return x.value;
}

static inline real plus(real x, real y) {
    return taylor_sum(x, y);
}

static inline real minus(real x, real y) {
    return taylor_difference(x, y);
}

static inline real negative(real x) {
    return taylor_scaled(-1.0, x);
}

static inline real times(real x, real y) {
    return taylor_product(x, y);
}

static inline real scaled(double factor, real x) {
    return taylor_scaled(factor, x);
}

static inline real quotient(real x, real y) {
    return taylor_quotient(x, y);
}

static inline real sine(real x) {
    return taylor_sine(x);
}

static inline real cosine(real x) {
    return taylor_cosine(x);
}

static inline real moving_as(real x, real y) {
    return (real){x.value, y.first, y.second};
}

/* Sources: the values, then their first and their second derivatives along the curve. Targets: the
 * first and the second derivatives of the results. */
enum { SOURCES = 3, TARGETS = 2 };
#define READ(sources, field) ((real){(sources)[0]->field, (sources)[1]->field, (sources)[2]->field})
#define PARTS(sources, field)                                                                      \
    { &(sources)[0]->field, &(sources)[1]->field, &(sources)[2]->field }
#define WRITE(targets, field, result)                                                              \
    do {                                                                                           \
        const real written = (result);                                                             \
        (targets)[0]->field = written.first;                                                       \
        (targets)[1]->field = written.second;                                                      \
    } while (0)

#endif
