/* The arithmetic of equations (equation.h) with doubles: values. */
#ifndef ARITHMETIC_H
#define ARITHMETIC_H

#include <math.h>

typedef double real;

static inline real constant(double x) {
    return x;
}

static inline double value_of(real x) {
    return x;
}

static inline real plus(real x, real y) {
    return x + y;
}

static inline real minus(real x, real y) {
    return x - y;
}

static inline real negative(real x) {
    return -x;
}

static inline real times(real x, real y) {
    return x * y;
}

static inline real scaled(double factor, real x) {
    return factor * x;
}

static inline real quotient(real x, real y) {
    return x / y;
}

static inline real sine(real x) {
    return sin(x);
}

static inline real cosine(real x) {
    return cos(x);
}

/* The value of x with the derivatives of y, for two that are the same but for rounding. */
static inline real moving_as(real x, real y) {
    return x;
}

/* What an equation reads and writes: here one structure each, with values. */
enum { SOURCES = 1, TARGETS = 1 };
#define READ(sources, field) ((sources)[0]->field)
#define PARTS(sources, field)                                                                      \
    { &(sources)[0]->field }
#define WRITE(targets, field, result) ((targets)[0]->field = (result))

#endif
