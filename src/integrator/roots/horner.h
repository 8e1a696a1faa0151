/* Values of a polynomial with their rounding. */
#ifndef HORNER_H
#define HORNER_H

#include "platform.h"

#include <math.h>

struct horner_value {
    double value;
    double slope;
    double rounding; /* bounds |value - p(s)|, also where each coefficient has been rounded once */
};

/* By Horner's scheme, for 0 <= s <= 1 and degree < 64. The rounding is (2 degree + 4) 2^-53 times
 * the sum of |c[k]| s^k (Higham, Accuracy and Stability of Numerical Algorithms, section 5.1). */
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

/* The value as if rounded once from twice the digits: the roundings of all products and sums are a
 * polynomial that corrects the first one (Graillat, Langlois and Louvet, Algorithms for accurate,
 * validated and fast polynomial evaluation, 2009). 0 where that is less than its error may be,
 * 2^-94 times the sum of |c[k]| s^k. 0 <= s <= 1, degree < 32, coefficients below 2^990. */
NONNULL double horner_compensated(const double c[], int degree, double s);

#endif
