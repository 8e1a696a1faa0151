/* Where an indicator reaches 0 within an internal step: the roots of its polynomial
 * p(s) = sum of c[k] s^k on (0, 1]. The step starts at s = 0 and ends at s = 1.
 *
 * Coefficients count as exact. Between neighbouring extrema, which are the roots of the derivative,
 * p has one root or none. The signs there are exact as far as |p| exceeds
 * 2^-94 size(s); size(s) = sum of |c[k]| s^k. With r(s) = (2 degree + 4) 2^-53 size(s), which
 * bounds the rounding of Horner's scheme, this is guaranteed:
 *
 * - Every change of sign is found, and to the last bit: s is the first double at which p has its
 *   new sign or is 0 (less than 2^-94 size(s)). Two of them may be missed, or be one touch, only
 *   where |p| <= 2 r between them.
 * - A touch is an extremum without change of sign. It is found where |p| <= r, and never where
 *   |p| > 2 r. The end of the step counts as one where |p(1)| <= r: by rounding, the root may be
 *   beyond it. Touches with nothing but |p| <= 2 r between them are one; beside a change of sign
 *   there is none.
 *
 * Coefficients are to be finite: with others no root is found, nor with zeros only. Nothing is
 * allocated. The same polynomial has the same roots on every platform.
 *
 * An indicator that is no polynomial itself is interpolated at Chebyshev points of the step. */
#pragma once

#include "platform.h"

#include <math.h>
#include <stdbool.h>

/* Returns the same as fmax, without the call. */
static inline double larger(double x, double y) {
    return x > y ? x : y;
}

/* ---- Values of a polynomial, with their rounding -------------------------------------------- */

struct horner_value {
    double value;
    double slope;
    double rounding; /* bound of |value - p(s)|, also if each coefficient has been rounded once */
};

/* Evaluates by Horner's scheme, for 0 <= s <= 1 and degree < 64. The rounding is (2 degree + 4)
 * 2^-53 times the sum of |c[k]| s^k (Higham, Accuracy and Stability of Numerical Algorithms,
 * section 5.1). */
NONNULL static inline struct horner_value horner(const double c[], int degree, double s) {
    double value = c[degree];
    double slope = 0.0;
    double size = fabs(value);
    for (int k = degree - 1; k >= 0; k--) {
        slope = slope * s + value;
        value = value * s + c[k];
        size = size * s + fabs(c[k]);
    }
    return (struct horner_value){value, slope, (2 * degree + 4) * 0x1p-53 * size};
}

/* Returns the value as if rounded once from twice the digits: the roundings of all products and
 * sums are a polynomial that corrects the first value (Graillat, Langlois and Louvet, Algorithms
 * for accurate, validated and fast polynomial evaluation, 2009). Returns 0 if the value is less
 * than its possible error, 2^-94 times the sum of |c[k]| s^k. 0 <= s <= 1, degree < 32,
 * coefficients below 2^990. */
NONNULL double horner_compensated(const double c[], int degree, double s);

/* ---- Interpolation at Chebyshev points ------------------------------------------------------ */

/* Largest number of values. With more, powers of s lose too many digits: interpolate the halves of
 * the step instead. */
enum { CHEBYSHEV_LENGTH = 17 };

/* Returns point k of count (3, 5, 9 or 17) in [0, 1], rising; the first is 0 and the last is 1.
 * Point k of count is point 2 k of 2 count - 1, whose value it shares. */
double chebyshev_point(int count, int k);

/* Writes the coefficients c[k] of s^k of the polynomial through values[k] at chebyshev_point(count,
 * k), both count long; c[0] is values[0]. Returns the larger of the last two coefficients of its
 * Chebyshev polynomials, in the unit of the values: a smooth function differs from the polynomial
 * by as much, and by a tenth or a hundredth if the coefficients fall quickly. Leaves out
 * coefficients within the rounding of the values: powers of s would make them larger. */
MUST_CHECK NONNULL double chebyshev_interpolate(int count, const double values[], double c[]);

/* ---- Roots ---------------------------------------------------------------------------------- */

/* Largest number of coefficients, and more than there can be roots. */
enum { ROOTS_LENGTH = 32 };

struct roots_polynomial {
    const double *c; /* degree + 1 coefficients, in the unit of p */
    int degree;      /* 0 to ROOTS_LENGTH - 1 */
    /* In the unit of p. If >= 0: the first coefficients, as long as they are within it, count as 0,
     * because p starts at a root that has been dealt with; the next root is found however close it
     * is. If < 0: p does not start at such a root. */
    double noise;
};

enum root_kind {
    ROOT_FALLS,   /* from above 0 to below; at the end of the step: to 0 */
    ROOT_RISES,   /* from below 0 to above; at the end of the step: to 0 */
    ROOT_TOUCHES, /* within rounding of 0 with no change of sign */
};

struct root {
    double s; /* in (0, 1] */
    enum root_kind kind;
};

/* Writes all roots in their order and returns their number. */
MUST_CHECK NONNULL int roots_find(const struct roots_polynomial *p,
                                  struct root roots[ROOTS_LENGTH]);

/* Does the same as roots_first, without the quick proof. */
MUST_CHECK NONNULL double roots_search_first(const struct roots_polynomial *p);

/* True if p > r on (0, 1], because p(s) >= c0 + c1 s + d s^2 > 0, where d is c2 plus the negative
 * coefficients behind it. False if that is not known. */
NONNULL static inline bool roots_is_above(const struct roots_polynomial *p) {
    // more than the rounding here and in Horner's scheme, as parts of each coefficient
    const double slack = 0x1p-45;
    const bool is_at_root = fabs(p->c[0]) <= p->noise;
    if (p->degree < (is_at_root ? 3 : 2)) {
        return false;
    }
    const double *c = is_at_root ? p->c + 1 : p->c;
    const int degree = is_at_root ? p->degree - 1 : p->degree;
    double odd = 0.0;
    double even = 0.0;
    int k = 3;
    for (; k < degree; k += 2) {
        odd += c[k] < 0.0 ? c[k] : 0.0;
        even += c[k + 1] < 0.0 ? c[k + 1] : 0.0;
    }
    if (k == degree) {
        odd += c[k] < 0.0 ? c[k] : 0.0;
    }
    const double rest = odd + even;
    const double c0 = c[0] - slack * c[0];
    const double c1 = c[1] - slack * fabs(c[1]);
    const double d = c[2] + rest - slack * (fabs(c[2]) - rest);
    const bool is_above_at_ends = c[0] > 0.0 && c[0] > p->noise && c0 + c1 + d > 0.0;
    return is_above_at_ends && (c1 >= 0.0 || c1 + 2.0 * d <= 0.0 || 4.0 * c0 * d > c1 * c1);
}

/* Returns the first s in (0, 1] at which p, above 0 before, is 0 or below, or touches 0. Returns 0
 * if p is below 0 right after the start, or 0 there with noise < 0, and INFINITY if p stays above.
 */
MUST_CHECK NONNULL static inline double roots_first(const struct roots_polynomial *p) {
    return roots_is_above(p) ? INFINITY : roots_search_first(p);
}

/* Returns about where offset + factor p falls to 0, by the parabola with the first three
 * coefficients of p; INFINITY if it does not. */
NONNULL double roots_guess(double offset, double factor, const double c[]);

/* ---- Falls ----------------------------------------------------------------------------------
 * Falls of an indicator to 0, given by its polynomial. A touch of 0 is no fall; near a restart,
 * rounding may leave an indicator on either side of 0. */

/* The rounding of some thousand steps, of one. */
static const double falls_roundings = 0x1p7;

struct fall {
    double error; /* error of p */
    double touch; /* depth below 0 that a fall leads to at least before the indicator rises again */
    double latest;   /* s; later falls need not be located */
    bool is_restart; /* true if p begins at a restart */
    bool *is_armed;  /* true if it has been above 0 since the restart; set when it rises */
    double *noise;   /* how far from 0 the indicator may be without having risen; grows if it is
                        farther below 0 at the restart */
};

/* Returns the first s in (0, 1] at which an indicator falls to 0; INFINITY if it does not fall, or
 * falls later than `latest`.
 *
 * p represents the indicator over the step, up to an error. A fall counts only once the indicator
 * is armed: rounding may leave it on either side of 0 at a restart. */
MUST_CHECK NONNULL double roots_first_fall(const struct roots_polynomial *p,
                                           const struct fall *fall);
