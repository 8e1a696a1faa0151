/* Functions of balls. A result contains the values at all numbers of the argument; where one of
 * them has none, it is unbounded.
 *
 * libm gives first approximations only: what they are off by is bounded here. */
#pragma once

#include "ball.h"

#define ROUGH 0x1p-20 /* by which libm's approximations are off at most, else they are not used */

/* 1 as a ball. */
static const struct ball ONE = {1.0, 0.0, 0.0};
/* ---- Sine and cosine ------------------------------------------------------------------------ */

/* first (1 - y / ((k + 1) (k + 2)) + y^2 / ((k + 1) ... (k + 4)) - ...) for 0 <= y < 1: terms
 * alternate and fall, so that the first one that is left out bounds the rest (Leibniz). */
static inline struct ball ball_alternating(struct ball first, struct ball y, double k) {
    const double small = 0x1p-100 * (fabs(first.hi) + 0x1p-700);
    struct ball sum = first;
    struct ball term = first;
    for (;;) {
        term = ball_quotient(ball_product(term, y), ball_exact(-(k + 1.0) * (k + 2.0)));
        if (!(ball_largest(term) > small)) { // also: no number
            return ball_widened(sum, ball_largest(term));
        }
        sum = ball_sum(sum, term);
        k += 2.0;
    }
}

/* sin x and cos x of a midpoint, by sin 2x = 2 sin x (1 - (1 - cos x)), 1 - cos 2x = 2 sin^2 x.
 * Both change by no more than x does. */
static inline void ball_sine_and_cosine(struct ball angle, struct ball *sine, struct ball *cosine) {
    if (!(fabs(angle.hi) <= 0x1p30)) {
        *sine = *cosine = ball_unbounded();
        return;
    }
    struct ball x = ball_midpoint(angle);
    int doublings = 0;
    // NOLINTNEXTLINE(cert-flp30-c, clang-analyzer-security.FloatLoopCounter): halving is exact
    for (double size = fabs(x.hi); size >= 0x1p-4; size *= 0.5) {
        x = ball_scaled(x, 0.5);
        doublings++;
    }
    const struct ball square = ball_product(x, x);
    struct ball s = ball_alternating(x, square, 1.0);
    struct ball versine = ball_alternating(ball_scaled(square, 0.5), square, 2.0);
    for (int i = 0; i < doublings; i++) {
        const struct ball before = s;
        s = ball_scaled(ball_difference(before, ball_product(before, versine)), 2.0);
        versine = ball_scaled(ball_product(before, before), 2.0);
    }
    *sine = ball_widened(s, angle.radius);
    *cosine = ball_widened(ball_difference(ONE, versine), angle.radius);
}

static struct ball ball_sin(struct ball x) {
    struct ball sine, cosine;
    ball_sine_and_cosine(x, &sine, &cosine);
    return sine;
}

static struct ball ball_cos(struct ball x) {
    struct ball sine, cosine;
    ball_sine_and_cosine(x, &sine, &cosine);
    return cosine;
}

/* ---- Other functions ------------------------------------------------------------------------- */

/* Every root is off by |x - q^2| / (root + q) from q. */
static struct ball ball_sqrt(struct ball x) {
    const double smallest = ball_smallest(x);
    if (!(smallest > 0.0 && x.hi > 0.0)) {
        return ball_unbounded();
    }
    const double first = sqrt(x.hi);
    const struct ball left = ball_difference(ball_midpoint(x), ball_of_product(first, first));
    struct ball root = ball_of_sum(first, left.hi / (2.0 * first));
    const double rest = ball_largest(ball_difference(x, ball_product(root, root)));
    const double sum = (ball_smallest(root) + sqrt(smallest) * INWARD) * INWARD;
    return ball_widened(root, (rest / sum + TINY) * OUTWARD);
}

/* e^x. With y = x / 2^n below 1/16, e^y - 1 is a sum whose rest is at most twice its last term, and
 * e^2y - 1 = (e^y - 1) (2 + (e^y - 1)). An x that is off by r <= 1 changes e^x by r (1 + r) of it.
 */
static struct ball ball_exp(struct ball x) {
    if (!(fabs(x.hi) <= 700.0 && x.radius <= 1.0)) {
        return ball_unbounded();
    }
    struct ball y = ball_midpoint(x.hi < 0.0 ? ball_negative(x) : x);
    int doublings = 0;
    // NOLINTNEXTLINE(cert-flp30-c, clang-analyzer-security.FloatLoopCounter): halving is exact
    for (double size = fabs(x.hi); size >= 0x1p-4; size *= 0.5) {
        y = ball_scaled(y, 0.5);
        doublings++;
    }
    struct ball grown = y, term = y;
    double k = 1.0;
    while (ball_largest(term) > 0x1p-108 * fabs(y.hi) + 0x1p-800) { // TINY adds up below
        k += 1.0;
        term = ball_quotient(ball_product(term, y), ball_exact(k));
        grown = ball_sum(grown, term);
    }
    grown = ball_widened(grown, 2.0 * ball_largest(term));
    for (int i = 0; i < doublings; i++) {
        grown = ball_product(grown, ball_sum(ball_exact(2.0), grown));
    }
    struct ball power = ball_sum(ONE, grown);
    power = x.hi < 0.0 ? ball_quotient(ONE, power) : power;
    return ball_widened(power, ball_largest(power) * x.radius * (1.0 + x.radius) * OUTWARD);
}

/* With y near log x and d = x e^-y - 1: log x = y + log(1 + d), of which d - d^2 / 2 + d^3 / 3 is
 * off by less than d^4. */
static struct ball ball_log(struct ball x) {
    const double smallest = ball_smallest(x);
    if (!(smallest > 0.0 && x.hi > 0.0 && x.hi < (double)INFINITY)) {
        return ball_unbounded();
    }
    const double y = log(x.hi);
    const struct ball share = ball_product(ball_midpoint(x), ball_exp(ball_exact(-y)));
    const struct ball d = ball_difference(share, ONE);
    const double size = ball_largest(d);
    if (!(size < ROUGH)) {
        return ball_unbounded();
    }
    const struct ball third = ball_quotient(d, ball_exact(3.0));
    const struct ball inner = ball_sum(ball_exact(-0.5), third);
    const struct ball rest = ball_sum(d, ball_product(ball_product(d, d), inner));
    const double off = size * size * size * size + x.radius / smallest + TINY;
    return ball_widened(ball_sum(ball_exact(y), rest), off * OUTWARD);
}

/* (1 - e^-2|x|) / (1 + e^-2|x|) with the sign of x; it changes by no more than x does. */
static struct ball ball_tanh(struct ball x) {
    const bool falls = x.hi < 0.0;
    const struct ball size = ball_scaled(ball_midpoint(falls ? x : ball_negative(x)), 2.0);
    const struct ball far = ball_around(0.0, 0x1p-1000); // e^-700 is smaller
    const struct ball power = size.hi < -700.0 ? far : ball_exp(size);
    const struct ball value = ball_quotient(ball_difference(ONE, power), ball_sum(ONE, power));
    return ball_widened(falls ? ball_negative(value) : value, x.radius);
}

/* With y near atan x, the angle between (1, x) and (cos y, sin y) is the rest; its tangent d is
 * off from it by less than |d|^3. The slope is at most 1 / (1 + x^2). */
static struct ball ball_atan(struct ball x) {
    const double y = atan(x.hi);
    struct ball sine, cosine;
    ball_sine_and_cosine(ball_exact(y), &sine, &cosine);
    const struct ball middle = ball_midpoint(x);
    const struct ball across = ball_difference(ball_product(middle, cosine), sine);
    const struct ball ahead = ball_sum(cosine, ball_product(middle, sine));
    const struct ball d = ball_quotient(across, ahead);
    const double size = ball_largest(d);
    if (!(size < ROUGH && ahead.hi > 0.0)) {
        return ball_unbounded();
    }
    const struct ball cube = ball_product(d, ball_product(d, d));
    const struct ball rest = ball_difference(d, ball_quotient(cube, ball_exact(3.0)));
    const double smallest = fmax(ball_smallest(x), 0.0);
    const double fifth = size * size * size * size * size + TINY;
    const double off = fifth + x.radius / (1.0 + smallest * smallest);
    return ball_widened(ball_sum(ball_exact(y), rest), off * OUTWARD);
}

/* ---- By their names -------------------------------------------------------------------------- */

typedef struct ball (*ball_function)(struct ball);

static const struct {
    const char *name;
    ball_function of;
} FUNCTIONS[] = {
    {"sin", ball_sin},   {"cos", ball_cos},   {"exp", ball_exp},   {"log", ball_log},
    {"sqrt", ball_sqrt}, {"atan", ball_atan}, {"tanh", ball_tanh},
};
