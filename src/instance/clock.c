#include "clock.h"

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

struct polynomial polynomial_through(const double values[POLYNOMIAL_NODES], double step_size) {
    // Newton's forward differences, and their series for the derivatives at the first node
    const double s = step_size / (POLYNOMIAL_NODES - 1);
    const double first[] = {values[1] - values[0], values[2] - values[1], values[3] - values[2]};
    const double second[] = {first[1] - first[0], first[2] - first[1]};
    const double third = second[1] - second[0];
    return (struct polynomial){{
        values[0],
        (first[0] - second[0] / 2.0 + third / 3.0) / s,
        (second[0] - third) / s / s,
        third / s / s / s,
    }};
}
