/* Where an indicator reaches 0 within an internal step: roots of its polynomial
 * p(s) = sum of c[k] s^k on (0, 1], of which s = 0 is the begin of the step and s = 1 its end.
 *
 * The coefficients count as exact. Between a polynomial's extrema, which are the roots of its
 * derivative, there is one root or none; the signs of p at these points are those of exact
 * arithmetic, by Horner's scheme with compensated rounding. What is guaranteed, where
 * r(s) = (2 degree + 4) 2^-53 sum of |c[k]| s^k, which bounds the rounding of Horner's scheme:
 *
 * - Every root at which p changes its sign is found, to the last bit: s is the first double at
 *   which p has its new sign, or is 0. Two of them are found apart where |p| exceeds 2 r between
 *   them, and mostly so where it does not.
 * - A touch, an extremum that does not change the sign, is found where |p| <= r, and not where
 *   |p| > 2 r. So is an end of the step at which |p| <= r: the root may be beyond it by rounding.
 *   Touches with nothing but rounding between them are one, and a touch beside a change of sign is
 *   none.
 *
 * Coefficients are to be finite; with others, or with zeros only, no root is found. Nothing is
 * allocated, and the same polynomial has the same roots on every platform. */
#ifndef ROOTS_H
#define ROOTS_H

#include "platform.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>

/* Coefficients at most, and more than there can be roots. */
enum { ROOTS_LENGTH = 32 };

struct roots_polynomial {
    const double *c; /* degree + 1 coefficients, in the unit of p */
    int degree;      /* 0 to ROOTS_LENGTH - 1 */
    /* >= 0: p begins at a root that has been dealt with if |c[0]| <= noise. Then this and all
     * further leading coefficients within the noise count as 0, and the roots are those of what is
     * left, divided by its power of s; the one at s = 0 is none of them, another may be as close to
     * it as it likes. < 0: p does not begin at such a root. In the unit of p. */
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

/* Writes all roots in their order and returns how many they are. */
MUST_CHECK NONNULL int roots_find(const struct roots_polynomial *p,
                                  struct root roots[ROOTS_LENGTH]);

/* roots_first without the quick proof. */
MUST_CHECK NONNULL double roots_search_first(const struct roots_polynomial *p);

/* Proves that p exceeds its rounding on (0, 1] from p(s) >= c0 + c1 s + d s^2, d = c2 + sum of the
 * negative coefficients behind it; false: it may, or may not. */
NONNULL static inline bool roots_is_above(const struct roots_polynomial *p) {
    // more than the rounding here and that of Horner's scheme, as parts of each coefficient
    const double slack = 0x1p-45;
    const bool is_at_root = fabs(p->c[0]) <= p->noise;
    const double *c = is_at_root ? p->c + 1 : p->c;
    const int degree = is_at_root ? p->degree - 1 : p->degree;
    if (degree < 2) {
        return false;
    }
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

/* The first s in (0, 1] at which p, above 0 before, is 0 or below, or touches 0; 0 if p is below 0
 * from the begin on; INFINITY if it stays above. */
MUST_CHECK NONNULL static inline double roots_first(const struct roots_polynomial *p) {
    return roots_is_above(p) ? INFINITY : roots_search_first(p);
}

/* The smallest roots_first of count polynomials. Writes which of them are at 0 there: this is
 * their own first root, or |p| is within the rounding of its value or of s. */
MUST_CHECK NONNULL double roots_earliest(size_t count, const struct roots_polynomial p[],
                                         bool is_at_root[]);

#endif
