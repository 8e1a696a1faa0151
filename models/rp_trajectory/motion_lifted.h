/* Arithmetic with a quantity that moves: its value, velocity and acceleration in time, each of them
 * with its first and second derivative along a curve (taylor.h). The rules are those of taylor.h
 * again, one level up: a curve along time gives the derivatives of orders 3 and 4 as well. */
#ifndef MOTION_LIFTED_H
#define MOTION_LIFTED_H

#include "taylor.h"

struct motion {
    struct taylor position;
    struct taylor velocity;     /* per s */
    struct taylor acceleration; /* per s2 */
};

/* At rest at position. */
static inline struct motion motion_rest(struct taylor position) {
    return (struct motion){.position = position};
}

static inline struct motion motion_sum(struct motion x, struct motion y) {
    return (struct motion){
        .position = taylor_sum(x.position, y.position),
        .velocity = taylor_sum(x.velocity, y.velocity),
        .acceleration = taylor_sum(x.acceleration, y.acceleration),
    };
}

static inline struct motion motion_difference(struct motion x, struct motion y) {
    return (struct motion){
        .position = taylor_difference(x.position, y.position),
        .velocity = taylor_difference(x.velocity, y.velocity),
        .acceleration = taylor_difference(x.acceleration, y.acceleration),
    };
}

static inline struct motion motion_scaled(struct taylor factor, struct motion x) {
    return (struct motion){
        .position = taylor_product(factor, x.position),
        .velocity = taylor_product(factor, x.velocity),
        .acceleration = taylor_product(factor, x.acceleration),
    };
}

static inline struct motion motion_product(struct motion x, struct motion y) {
    const struct taylor twice = taylor_scaled(2.0, taylor_product(x.velocity, y.velocity));
    return (struct motion){
        .position = taylor_product(x.position, y.position),
        .velocity = taylor_sum(taylor_product(x.velocity, y.position),
                               taylor_product(x.position, y.velocity)),
        .acceleration = taylor_sum(taylor_sum(taylor_product(x.acceleration, y.position), twice),
                                   taylor_product(x.position, y.acceleration)),
    };
}

/* From x = root^2, differentiated. */
static inline struct motion motion_square_root(struct motion x) {
    const struct taylor root = taylor_square_root(x.position);
    const struct taylor twice_root = taylor_scaled(2.0, root);
    const struct taylor velocity = taylor_quotient(x.velocity, twice_root);
    const struct taylor rest =
        taylor_difference(x.acceleration, taylor_scaled(2.0, taylor_square(velocity)));
    return (struct motion){root, velocity, taylor_quotient(rest, twice_root)};
}

static inline struct motion motion_sine(struct motion x) {
    const struct taylor s = taylor_sine(x.position);
    const struct taylor c = taylor_cosine(x.position);
    return (struct motion){
        .position = s,
        .velocity = taylor_product(c, x.velocity),
        .acceleration = taylor_difference(taylor_product(c, x.acceleration),
                                          taylor_product(s, taylor_square(x.velocity))),
    };
}

static inline struct motion motion_cosine(struct motion x) {
    const struct taylor s = taylor_sine(x.position);
    const struct taylor c = taylor_cosine(x.position);
    const struct taylor turning =
        taylor_sum(taylor_product(s, x.acceleration), taylor_product(c, taylor_square(x.velocity)));
    return (struct motion){
        .position = c,
        .velocity = taylor_scaled(-1.0, taylor_product(s, x.velocity)),
        .acceleration = taylor_scaled(-1.0, turning),
    };
}

/* From (x^2 + y^2) angle' = x y' - y x', differentiated. */
static inline struct motion motion_atan2(struct motion y, struct motion x) {
    const struct taylor r2 = taylor_sum(taylor_square(x.position), taylor_square(y.position));
    const struct taylor half_r2_rate =
        taylor_sum(taylor_product(x.position, x.velocity), taylor_product(y.position, y.velocity));
    const struct taylor area_rate = taylor_difference(taylor_product(x.position, y.velocity),
                                                      taylor_product(y.position, x.velocity));
    const struct taylor area_acceleration = taylor_difference(
        taylor_product(x.position, y.acceleration), taylor_product(y.position, x.acceleration));
    const struct taylor velocity = taylor_quotient(area_rate, r2);
    const struct taylor rest = taylor_difference(
        area_acceleration, taylor_scaled(2.0, taylor_product(velocity, half_r2_rate)));
    return (struct motion){
        taylor_atan2(y.position, x.position),
        velocity,
        taylor_quotient(rest, r2),
    };
}

#endif
