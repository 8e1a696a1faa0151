/* The arithmetic of equations (equation.h) with gradients: derivatives by up to six variables, all
 * from one evaluation. */
#ifndef ARITHMETIC_H
#define ARITHMETIC_H

#include <math.h>

struct gradient {
    double value;
    double by[6];
};

typedef struct gradient real;

/* The chain rule for a function of x, and for one of x and y. Written out: gcc does not keep arrays
 * in registers that a loop goes over, which makes it five times slower. */
static inline real function_of(double value, double by_x, real x) {
    return (real){value,
                  {by_x * x.by[0], by_x * x.by[1], by_x * x.by[2], by_x * x.by[3], by_x * x.by[4],
                   by_x * x.by[5]}};
}

static inline real function_of_two(double value, double by_x, real x, double by_y, real y) {
    return (real){value,
                  {by_x * x.by[0] + by_y * y.by[0], by_x * x.by[1] + by_y * y.by[1],
                   by_x * x.by[2] + by_y * y.by[2], by_x * x.by[3] + by_y * y.by[3],
                   by_x * x.by[4] + by_y * y.by[4], by_x * x.by[5] + by_y * y.by[5]}};
}

static inline real constant(double x) {
    return (real){.value = x};
}

/* The variable with this index from 0 to 5. */
static inline real variable(double x, int index) {
    real result = {.value = x};
    result.by[index] = 1.0;
    return result;
}

static inline double value_of(real x) {
    return x.value;
}

static inline real plus(real x, real y) {
    return function_of_two(x.value + y.value, 1.0, x, 1.0, y);
}

static inline real minus(real x, real y) {
    return function_of_two(x.value - y.value, 1.0, x, -1.0, y);
}

static inline real scaled(double factor, real x) {
    return function_of(factor * x.value, factor, x);
}

static inline real negative(real x) {
    return scaled(-1.0, x);
}

static inline real times(real x, real y) {
    return function_of_two(x.value * y.value, y.value, x, x.value, y);
}

/* From x = quotient y, differentiated. */
static inline real quotient(real x, real y) {
    const double value = x.value / y.value;
    const real rest = minus(x, scaled(value, y));
    return (real){value,
                  {rest.by[0] / y.value, rest.by[1] / y.value, rest.by[2] / y.value,
                   rest.by[3] / y.value, rest.by[4] / y.value, rest.by[5] / y.value}};
}

static inline real sine(real x) {
    return function_of(sin(x.value), cos(x.value), x);
}

static inline real cosine(real x) {
    return function_of(cos(x.value), -sin(x.value), x);
}

/* What an equation reads is constant; the variables are passed to it. */
enum { SOURCES = 1 };
#define READ(sources, field) constant((sources)[0]->field)
#define PARTS(sources, field)                                                                      \
    { &(sources)[0]->field }

#endif
