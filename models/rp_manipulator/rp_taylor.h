/* Arithmetic with a quantity and its first and second derivative along a curve: Taylor polynomials
 * of degree 2, propagated by the rules of sum, product, quotient and chain. Each result is exact
 * but for rounding; a derivative that is zero because its quantity rests is zero exactly. */
#ifndef RP_TAYLOR_H
#define RP_TAYLOR_H

#include <math.h>

/* x, dx/dt and d2x/dt2 (not divided by 2) at one point of the curve, t being its parameter. */
struct rp_taylor {
    double value;
    double first;
    double second;
};

static inline struct rp_taylor rp_sum(struct rp_taylor x, struct rp_taylor y) {
    return (struct rp_taylor){x.value + y.value, x.first + y.first, x.second + y.second};
}

static inline struct rp_taylor rp_difference(struct rp_taylor x, struct rp_taylor y) {
    return (struct rp_taylor){x.value - y.value, x.first - y.first, x.second - y.second};
}

static inline struct rp_taylor rp_scaled(double factor, struct rp_taylor x) {
    return (struct rp_taylor){factor * x.value, factor * x.first, factor * x.second};
}

static inline struct rp_taylor rp_product(struct rp_taylor x, struct rp_taylor y) {
    return (struct rp_taylor){
        .value = x.value * y.value,
        .first = x.first * y.value + x.value * y.first,
        .second = x.second * y.value + 2.0 * x.first * y.first + x.value * y.second,
    };
}

static inline struct rp_taylor rp_square(struct rp_taylor x) {
    return rp_product(x, x);
}

/* From x = quotient y, differentiated. */
static inline struct rp_taylor rp_quotient(struct rp_taylor x, struct rp_taylor y) {
    const double value = x.value / y.value;
    const double first = (x.first - value * y.first) / y.value;
    const double second = (x.second - 2.0 * first * y.first - value * y.second) / y.value;
    return (struct rp_taylor){value, first, second};
}

static inline struct rp_taylor rp_sine(struct rp_taylor x) {
    const double s = sin(x.value);
    const double c = cos(x.value);
    return (struct rp_taylor){s, c * x.first, c * x.second - s * x.first * x.first};
}

static inline struct rp_taylor rp_cosine(struct rp_taylor x) {
    const double s = sin(x.value);
    const double c = cos(x.value);
    return (struct rp_taylor){c, -s * x.first, -s * x.second - c * x.first * x.first};
}

#endif
