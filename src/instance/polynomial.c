#include "polynomial.h"

double polynomial_value(const struct polynomial *polynomial, double t) {
    const double *d = polynomial->d;
    return d[0] + t * (d[1] + t / 2.0 * (d[2] + t / 3.0 * d[3]));
}

struct polynomial polynomial_shifted(const struct polynomial *polynomial, double t) {
    const double *d = polynomial->d;
    return (struct polynomial){{
        polynomial_value(polynomial, t),
        d[1] + t * (d[2] + t / 2.0 * d[3]),
        d[2] + t * d[3],
        d[3],
    }};
}
