/* Balls: sets of real numbers | x - (hi + lo) | <= radius, and arithmetic whose results contain
 * what follows from any numbers in the operands. Needs IEEE doubles, rounding to nearest and no
 * fused operations, and knows no model.
 *
 * The midpoint is a double-double: |lo| <= 2^-53 |hi|. A radius sums up
 *   - what the operands' radii make of the result,
 *   - HALF_ULP times every rounded value, for its rounding,
 *   - TINY, where products may underflow,
 * and is enlarged by OUTWARD for the roundings of that sum itself, fewer than 30 of 2^-53 each.
 * What overflows has an infinite radius or parts that are not numbers; `ball_largest` shows it. */
#pragma once

#include <float.h>
#include <math.h>
#include <stdbool.h>

#ifdef __FAST_MATH__
#error "without -ffast-math: errors of operations would be calculated as 0"
#endif
_Static_assert(FLT_EVAL_METHOD == 0, "operations on doubles give doubles");

/* no fused operations, whatever the options are */
#ifdef __clang__
#pragma clang fp contract(off)
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off")
#endif

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

/* All numbers: what has no value that could be bounded. */
static inline struct ball ball_unbounded(void) {
    return ball_around(0.0, (double)INFINITY);
}

static inline struct ball ball_midpoint(struct ball x) {
    return (struct ball){x.hi, x.lo, 0.0};
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

/* a + b */
static inline struct ball ball_of_sum(double a, double b) {
    const double sum = a + b;
    const double b_part = sum - a;
    return (struct ball){sum, (a - (sum - b_part)) + (b - b_part), 0.0};
}

/* Half of the digits of a: a = high + (a - high). */
static inline double high_half(double a) {
    const double shifted = 134217729.0 * a; /* 2^27 + 1 */
    return shifted - (shifted - a);
}

/* a b, but for underflow */
static inline struct ball ball_of_product(double a, double b) {
    const double product = a * b;
    const double a_high = high_half(a), a_low = a - a_high;
    const double b_high = high_half(b), b_low = b - b_high;
    const double error = ((a_high * b_high - product) + a_high * b_low + a_low * b_high);
    return (struct ball){product, error + a_low * b_low, 0.0};
}

/* ---- Arithmetic ----------------------------------------------------------------------------- */

static inline struct ball ball_negative(struct ball x) {
    return (struct ball){-x.hi, -x.lo, x.radius};
}

/* By a power of two: exact but for underflow. */
static inline struct ball ball_scaled(struct ball x, double power_of_two) {
    const double radius = (x.radius * power_of_two + TINY) * OUTWARD;
    return (struct ball){x.hi * power_of_two, x.lo * power_of_two, radius};
}

static inline struct ball ball_sum(struct ball x, struct ball y) {
    const struct ball high = ball_of_sum(x.hi, y.hi), low = ball_of_sum(x.lo, y.lo);
    const double lower = high.lo + low.hi;
    const struct ball sum = ball_of_sum(high.hi, lower);
    const double rest = sum.lo + low.lo;
    const double rounding = HALF_ULP * (fabs(lower) + fabs(rest));
    struct ball result = ball_of_sum(sum.hi, rest);
    result.radius = (x.radius + y.radius + rounding) * OUTWARD;
    return result;
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
        const struct ball product = ball_of_product(a.hi, b.hi);
        const struct ball sum = ball_of_sum(high, product.hi);
        const double term = sum.lo + (product.lo + (a.hi * b.lo + a.lo * b.hi));
        high = sum.hi;
        low += term;
        products += fabs(product.hi);
        low_sizes += fabs(term) + fabs(low);
        radius += fabs(a.hi) * b.radius + a.radius * (fabs(b.hi) + b.radius);
    }
    struct ball result = ball_of_sum(high, low);
    result.radius = radius + HALF_ULP * (low_sizes + 8.0 * HALF_ULP * products) + TINY * (n + 1);
    // OUTWARD for every 16 terms: each adds a rounding
    for (int i = 0; i <= n; i += 16) {
        result.radius *= OUTWARD;
    }
    return result;
}

static inline struct ball ball_product(struct ball x, struct ball y) {
    return ball_convolution(&x, &y, 0);
}

/* The sum of x_i y_i. */
static inline struct ball ball_dot(const double x[], const struct ball y[], int count) {
    struct ball sum = ball_exact(0.0);
    for (int i = 0; i < count; i++) {
        sum = ball_sum(sum, ball_product(ball_exact(x[i]), y[i]));
    }
    return sum;
}

/* The quotient of the midpoints is corrected once; what then remains of x - quotient y, as a ball,
 * over the smallest |y| bounds the distance of every quotient. */
static inline struct ball ball_quotient(struct ball x, struct ball y) {
    const double first = x.hi / y.hi;
    const struct ball product = ball_product(ball_exact(first), ball_midpoint(y));
    const struct ball left = ball_difference(ball_midpoint(x), product);
    struct ball quotient = ball_of_sum(first, left.hi / y.hi);
    const double remainder = ball_largest(ball_difference(x, ball_product(quotient, y)));
    const double smallest = ball_smallest(y);
    const bool divides = smallest > 0.0;
    quotient.radius = divides ? (remainder / smallest + TINY) * OUTWARD : (double)INFINITY;
    return quotient;
}
