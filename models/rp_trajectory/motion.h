/* Arithmetic with a quantity that moves: the rules of sum, product, quotient and chain. */
#pragma once

#include "../real.h"

struct motion {
    real position;
    real velocity;     /* per s */
    real acceleration; /* per s2 */
};

/* At rest at position. */
static inline struct motion motion_rest(real position) {
    return (struct motion){.position = position, .velocity = 0.0, .acceleration = 0.0};
}

static inline struct motion motion_sum(struct motion x, struct motion y) {
    return (struct motion){
        .position = x.position + y.position,
        .velocity = x.velocity + y.velocity,
        .acceleration = x.acceleration + y.acceleration,
    };
}

static inline struct motion motion_difference(struct motion x, struct motion y) {
    return (struct motion){
        .position = x.position - y.position,
        .velocity = x.velocity - y.velocity,
        .acceleration = x.acceleration - y.acceleration,
    };
}

static inline struct motion motion_scaled(real factor, struct motion x) {
    return (struct motion){
        .position = factor * x.position,
        .velocity = factor * x.velocity,
        .acceleration = factor * x.acceleration,
    };
}

static inline struct motion motion_product(struct motion x, struct motion y) {
    return (struct motion){
        .position = x.position * y.position,
        .velocity = x.velocity * y.position + x.position * y.velocity,
        .acceleration = x.acceleration * y.position + 2.0 * (x.velocity * y.velocity) +
                        x.position * y.acceleration,
    };
}

/* From x = root^2, differentiated. */
static inline struct motion motion_square_root(struct motion x) {
    const real root = sqrt(x.position);
    const real twice_root = 2.0 * root;
    const real velocity = x.velocity / twice_root;
    const real rest = x.acceleration - 2.0 * (velocity * velocity);
    return (struct motion){root, velocity, rest / twice_root};
}

static inline struct motion motion_sine(struct motion x) {
    const real s = sin(x.position), c = cos(x.position);
    return (struct motion){
        .position = s,
        .velocity = c * x.velocity,
        .acceleration = c * x.acceleration - s * (x.velocity * x.velocity),
    };
}

static inline struct motion motion_cosine(struct motion x) {
    const real s = sin(x.position), c = cos(x.position);
    return (struct motion){
        .position = c,
        .velocity = -(s * x.velocity),
        .acceleration = -(s * x.acceleration + c * (x.velocity * x.velocity)),
    };
}

/* From (x^2 + y^2) angle' = x y' - y x', differentiated. */
static inline struct motion motion_atan2(struct motion y, struct motion x) {
    const real r2 = x.position * x.position + y.position * y.position;
    const real half_r2_rate = x.position * x.velocity + y.position * y.velocity;
    const real area_rate = x.position * y.velocity - y.position * x.velocity;
    const real area_acceleration = x.position * y.acceleration - y.position * x.acceleration;
    const real velocity = area_rate / r2;
    const real rest = area_acceleration - 2.0 * (velocity * half_r2_rate);
    return (struct motion){atan2(y.position, x.position), velocity, rest / r2};
}
