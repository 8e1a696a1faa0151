/* The polynomial of an indicator that is not one itself: through its values at Chebyshev points of
 * the step. */
#ifndef CHEBYSHEV_H
#define CHEBYSHEV_H

#include "platform.h"

/* Values at most. With more, powers of s lose too many digits: interpolate the halves of the step
 * instead. */
enum { CHEBYSHEV_LENGTH = 17 };

/* Point k of count (3, 5, 9 or 17) in [0, 1], rising; the first is 0 and the last is 1. Point k of
 * count is point 2 k of 2 count - 1, where its value may be taken from. */
double chebyshev_point(int count, int k);

/* Writes the coefficients c[k] of s^k of the polynomial through values[k] at chebyshev_point(count,
 * k), both count long; c[0] is values[0]. Returns the larger of the last two coefficients of its
 * Chebyshev polynomials, in the unit of the values: a smooth function differs from the polynomial
 * by as much, and by a tenth or a hundredth where the coefficients fall quickly. Coefficients
 * within the rounding of the values are left out: powers of s would make them larger. */
MUST_CHECK NONNULL double chebyshev_interpolate(int count, const double values[], double c[]);

#endif
