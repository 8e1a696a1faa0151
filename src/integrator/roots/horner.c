#include "horner.h"

NO_FUSED_OPERATIONS

/* x = high + low, of 26 digits each, so that products of such parts are exact (Dekker). */
struct halves {
    double high;
    double low;
};

static inline struct halves halved(double x) {
    const double large = 0x1.000002p27 * x;
    const double high = large - (large - x);
    return (struct halves){high, x - high};
}

double horner_compensated(const double c[], int degree, double s) {
    const struct halves by = halved(s);
    double value = c[degree];
    double error = 0.0;
    double size = fabs(value);
    for (int k = degree - 1; k >= 0; k--) {
        const double product = value * s;
        const struct halves x = halved(value);
        const double of_product =
            x.low * by.low - (((product - x.high * by.high) - x.low * by.high) - x.high * by.low);
        // the sum and its rounding (Knuth)
        const double sum = product + c[k];
        const double added = sum - product;
        const double of_sum = (product - (sum - added)) + (c[k] - added);
        error = error * s + (of_product + of_sum);
        value = sum;
        size = size * s + fabs(c[k]);
    }
    const double corrected = value + error;
    return fabs(corrected) > 0x1p-94 * size ? corrected : 0.0;
}
