/* Balls: sets of real numbers | x - (hi + lo) | <= radius, and arithmetic whose results contain
 * what follows from any numbers in the operands. Needs IEEE doubles, rounding to nearest and no
 * fused operations, and knows no model.
 *
 * The midpoint is a double-double: |lo| <= 2^-53 |hi|. A radius sums up
 *   - what the operands' radii make of the result,
 *   - HALF_ULP times every rounded value, for its rounding,
 *   - TINY, where products may underflow,
 * and is enlarged by OUTWARD for the roundings of that sum itself, fewer than 30 of 2^-53 each.
 * What overflows has an infinite radius or parts that are no numbers: ask `ball_is_finite`. */
#ifndef BALL_H
#define BALL_H

#include <float.h>
#include <math.h>
#include <stdbool.h>

struct ball {
    double hi, lo; /* midpoint */
    double radius; /* not negative */
};

#define HALF_ULP 0x1p-53
#define OUTWARD  (1.0 + 0x1p-48)
#define INWARD   (1.0 - 0x1p-48)
#define TINY     0x1p-900 /* above every underflow of an operation, below all that matters */

static inline struct ball ball_exact(double value) {
    return (struct ball){value, 0.0, 0.0};
}

static inline struct ball ball_around(double value, double radius) {
    return (struct ball){value, 0.0, radius};
}

static inline struct ball ball_midpoint(struct ball x) {
    return (struct ball){x.hi, x.lo, 0.0};
}

static inline bool ball_is_finite(struct ball x) {
    return fabs(x.hi) <= DBL_MAX && fabs(x.lo) <= DBL_MAX && x.radius <= DBL_MAX;
}

/* ---- Bounds, rounded to the safe side -------------------------------------------------------- */

/* Not below any |x|. */
static inline double ball_largest(struct ball x) {
    return (fabs(x.hi) + fabs(x.lo) + x.radius) * OUTWARD;
}

/* Not above any |x|; 0 or less if x may be 0. */
static inline double ball_smallest(struct ball x) {
    return (fabs(x.hi) - (fabs(x.lo) + x.radius) * OUTWARD) * INWARD;
}

/* The same with a larger radius. */
static inline struct ball ball_widened(struct ball x, double by) {
    return (struct ball){x.hi, x.lo, (x.radius + by) * OUTWARD};
}

/* ---- Exact transformations (Knuth; Dekker and Veltkamp) ------------------------------------- */

/* a + b = sum + error */
static inline double two_sum(double a, double b, double *error) {
    const double sum = a + b;
    const double b_part = sum - a;
    *error = (a - (sum - b_part)) + (b - b_part);
    return sum;
}

/* Half of the digits of a: a = high + (a - high). */
static inline double high_half(double a) {
    const double shifted = 134217729.0 * a; /* 2^27 + 1 */
    return shifted - (shifted - a);
}

/* a b = product + error, but for underflow */
static inline double two_product(double a, double b, double *error) {
    const double product = a * b;
    const double a_high = high_half(a);
    const double b_high = high_half(b);
    const double a_low = a - a_high;
    const double b_low = b - b_high;
    *error = ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low;
    return product;
}

/* ---- Arithmetic ----------------------------------------------------------------------------- */

static inline struct ball ball_negative(struct ball x) {
    return (struct ball){-x.hi, -x.lo, x.radius};
}

/* a - b of two numbers, exactly */
static inline struct ball ball_between(double b, double a) {
    double error;
    const double difference = two_sum(a, -b, &error);
    return (struct ball){difference, error, 0.0};
}

/* By a power of two: exact but for underflow. */
static inline struct ball ball_scaled(struct ball x, double power_of_two) {
    const double radius = (x.radius * power_of_two + TINY) * OUTWARD;
    return (struct ball){x.hi * power_of_two, x.lo * power_of_two, radius};
}

static inline struct ball ball_sum(struct ball x, struct ball y) {
    double high_error, low_error, error, lo;
    const double high = two_sum(x.hi, y.hi, &high_error);
    const double low = high_error + two_sum(x.lo, y.lo, &low_error);
    const double sum = two_sum(high, low, &error);
    const double rest = error + low_error;
    const double hi = two_sum(sum, rest, &lo);
    const double rounding = HALF_ULP * (fabs(low) + fabs(rest));
    return (struct ball){hi, lo, (x.radius + y.radius + rounding) * OUTWARD};
}

static inline struct ball ball_difference(struct ball x, struct ball y) {
    return ball_sum(x, ball_negative(y));
}

/* The sum of x_i y_(n - i) over i = 0 .. n. Products of the high parts and their sum are exact,
 * with errors that go with the lower products into `low`. One of these is at most 2^-53 times the
 * product of the high parts, so 8 HALF_ULP^2 times that covers their roundings and the lowest
 * product. */
static inline struct ball ball_convolution(const struct ball *x, const struct ball *y, int n) {
    double high = 0.0, low = 0.0;
    double products = 0.0, low_sizes = 0.0, radius = 0.0;
    for (int i = 0; i <= n; i++) {
        const struct ball a = x[i], b = y[n - i];
        double product_error, sum_error;
        const double product = two_product(a.hi, b.hi, &product_error);
        high = two_sum(high, product, &sum_error);
        const double lower = product_error + (a.hi * b.lo + a.lo * b.hi);
        const double term = sum_error + lower;
        low += term;
        products += fabs(product);
        low_sizes += fabs(term) + fabs(low);
        radius += fabs(a.hi) * b.radius + a.radius * (fabs(b.hi) + b.radius);
    }
    double lo;
    const double hi = two_sum(high, low, &lo);
    radius += HALF_ULP * (low_sizes + 8.0 * HALF_ULP * products) + TINY * (n + 1);
    // OUTWARD for every 16 terms: each adds a rounding
    for (int i = 0; i <= n; i += 16) {
        radius *= OUTWARD;
    }
    return (struct ball){hi, lo, radius};
}

static inline struct ball ball_product(struct ball x, struct ball y) {
    return ball_convolution(&x, &y, 0);
}

static inline struct ball ball_times(double factor, struct ball x) {
    return ball_product(ball_exact(factor), x);
}

/* The sum of x_i y_i. */
static inline struct ball ball_dot(const double x[], const struct ball y[], int count) {
    struct ball sum = ball_exact(0.0);
    for (int i = 0; i < count; i++) {
        sum = ball_sum(sum, ball_times(x[i], y[i]));
    }
    return sum;
}

/* The quotient of the midpoints is corrected once; what then remains of x - quotient y, as a ball,
 * over the smallest |y| bounds the distance of every quotient. */
static inline struct ball ball_quotient(struct ball x, struct ball y) {
    const double first = x.hi / y.hi;
    const struct ball left = ball_difference(ball_midpoint(x), ball_times(first, ball_midpoint(y)));
    struct ball quotient = {0.0, 0.0, 0.0};
    quotient.hi = two_sum(first, left.hi / y.hi, &quotient.lo);

    const double remainder = ball_largest(ball_difference(x, ball_product(quotient, y)));
    const double smallest = ball_smallest(y);
    const bool divides = smallest > 0.0;
    quotient.radius = divides ? (remainder / smallest + TINY) * OUTWARD : (double)INFINITY;
    return quotient;
}

/* ---- Sine and cosine ------------------------------------------------------------------------ */

#define HALVED_BELOW 0x1p-4
#define TAIL         0x1p-100 /* terms below this part of the first one are left out */

/* first (1 - y / ((k + 1) (k + 2)) + y^2 / ((k + 1) ... (k + 4)) - ...) for 0 <= y < 1: terms
 * alternate and fall, so that the first one that is left out bounds the rest (Leibniz). */
static inline struct ball ball_alternating(struct ball first, struct ball y, double k) {
    const double small = TAIL * (fabs(first.hi) + 0x1p-700);
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

/* sin x and 1 - cos x of a midpoint, by sin 2x = 2 sin x (1 - (1 - cos x)), 1 - cos 2x = 2 sin^2 x
 */
static inline void ball_sine_and_versine(struct ball x, struct ball *sine, struct ball *versine) {
    int doublings = 0;
    // NOLINTNEXTLINE(cert-flp30-c, clang-analyzer-security.FloatLoopCounter): halving is exact
    for (double size = fabs(x.hi); size >= HALVED_BELOW; size *= 0.5) {
        x = ball_scaled(x, 0.5);
        doublings++;
    }
    const struct ball square = ball_product(x, x);
    *sine = ball_alternating(x, square, 1.0);
    *versine = ball_alternating(ball_scaled(square, 0.5), square, 2.0);
    for (int i = 0; i < doublings; i++) {
        const struct ball s = *sine;
        *sine = ball_scaled(ball_difference(s, ball_product(s, *versine)), 2.0);
        *versine = ball_scaled(ball_product(s, s), 2.0);
    }
}

/* sin x and cos x. Both change by no more than x does. */
static inline void ball_sine_and_cosine(struct ball x, struct ball *sine, struct ball *cosine) {
    struct ball s, versine;
    if (!(fabs(x.hi) <= 0x1p30)) {
        *sine = *cosine = ball_around(0.0, INFINITY);
        return;
    }
    ball_sine_and_versine(ball_midpoint(x), &s, &versine);
    *sine = ball_widened(s, x.radius);
    *cosine = ball_widened(ball_difference(ball_exact(1.0), versine), x.radius);
}

#endif
