/* Arithmetic with a quantity and its first and second derivative along a curve: Taylor polynomials
 * of degree 2, propagated by the rules of sum, product, quotient and chain. Each result is exact
 * but for rounding; a derivative that is zero because its quantity rests is zero exactly. */
#ifndef TAYLOR_H
#define TAYLOR_H

#include <math.h>

/* x, dx/dt and d2x/dt2 (not divided by 2) at one point of the curve, t being its parameter. */
struct taylor {
    double value;
    double first;
    double second;
};

static inline struct taylor taylor_sum(struct taylor x, struct taylor y) {
    return (struct taylor){x.value + y.value, x.first + y.first, x.second + y.second};
}

static inline struct taylor taylor_difference(struct taylor x, struct taylor y) {
    return (struct taylor){x.value - y.value, x.first - y.first, x.second - y.second};
}

static inline struct taylor taylor_scaled(double factor, struct taylor x) {
    return (struct taylor){factor * x.value, factor * x.first, factor * x.second};
}

static inline struct taylor taylor_product(struct taylor x, struct taylor y) {
    return (struct taylor){
        .value = x.value * y.value,
        .first = x.first * y.value + x.value * y.first,
        .second = x.second * y.value + 2.0 * x.first * y.first + x.value * y.second,
    };
}

static inline struct taylor taylor_square(struct taylor x) {
    return taylor_product(x, x);
}

/* From x = quotient y, differentiated. */
static inline struct taylor taylor_quotient(struct taylor x, struct taylor y) {
    const double value = x.value / y.value;
    const double first = (x.first - value * y.first) / y.value;
    const double second = (x.second - 2.0 * first * y.first - value * y.second) / y.value;
    return (struct taylor){value, first, second};
}

/* From x = root^2, differentiated. */
static inline struct taylor taylor_square_root(struct taylor x) {
    const double root = sqrt(x.value);
    const double first = x.first / (2.0 * root);
    const double second = (x.second - 2.0 * first * first) / (2.0 * root);
    return (struct taylor){root, first, second};
}

static inline struct taylor taylor_sine(struct taylor x) {
    const double s = sin(x.value);
    const double c = cos(x.value);
    return (struct taylor){s, c * x.first, c * x.second - s * x.first * x.first};
}

static inline struct taylor taylor_cosine(struct taylor x) {
    const double s = sin(x.value);
    const double c = cos(x.value);
    return (struct taylor){c, -s * x.first, -s * x.second - c * x.first * x.first};
}

/* From (x^2 + y^2) angle' = x y' - y x', differentiated. */
static inline struct taylor taylor_atan2(struct taylor y, struct taylor x) {
    const double r2 = x.value * x.value + y.value * y.value;
    const double half_r2_rate = x.value * x.first + y.value * y.first;
    const double first = (x.value * y.first - y.value * x.first) / r2;
    const double second =
        (x.value * y.second - y.value * x.second - 2.0 * first * half_r2_rate) / r2;
    return (struct taylor){atan2(y.value, x.value), first, second};
}

#endif
