#include "chebyshev.h"

#include <math.h>

enum { LAST = CHEBYSHEV_LENGTH - 1 };

/* cos(k pi / 16). */
static double cosine(unsigned k) {
    // clang-format off
    static const double table[2 * LAST] = {
        1.0, 0.9807852804032304, 0.9238795325112867, 0.8314696123025452,
        0.7071067811865476, 0.5555702330196022, 0.3826834323650898, 0.19509032201612828,
        0.0, -0.19509032201612828, -0.3826834323650898, -0.5555702330196022,
        -0.7071067811865476, -0.8314696123025452, -0.9238795325112867, -0.9807852804032304,
        -1.0, -0.9807852804032304, -0.9238795325112867, -0.8314696123025452,
        -0.7071067811865476, -0.5555702330196022, -0.3826834323650898, -0.19509032201612828,
        0.0, 0.19509032201612828, 0.3826834323650898, 0.5555702330196022,
        0.7071067811865476, 0.8314696123025452, 0.9238795325112867, 0.9807852804032304,
    };
    // clang-format on
    return table[k % (2 * LAST)];
}

double chebyshev_point(int count, int k) {
    return 0.5 - 0.5 * cosine((unsigned)(k * (LAST / (count - 1))));
}

/* Writes the coefficients of Chebyshev polynomials of 2 s - 1, for the values less the first one.
 */
static void transform(int count, const double values[], double coefficients[]) {
    const int last = count - 1;
    const int spacing = LAST / last;
    double weighted[CHEBYSHEV_LENGTH];
    for (int k = 1; k <= last; k++) {
        weighted[k] = (k == last ? 0.5 : 1.0) * (values[k] - values[0]);
    }
    for (int i = 0; i <= last; i++) {
        const unsigned step = (unsigned)(i * spacing);
        double sum = 0.0;
        for (int k = last; k > 0; k--) {
            sum += weighted[k] * cosine((unsigned)(last - k) * step);
        }
        coefficients[i] = (i == 0 || i == last ? 1.0 : 2.0) / last * sum;
    }
}

/* Writes the powers of s in a Chebyshev polynomial, from those in the two before it:
 * T[i] = (4 s - 2) T[i - 1] - T[i - 2], T[1] = (2 s - 1) T[0]. They take their places. */
static void next_powers(int i, double powers[], double before[]) {
    const double factor = i == 1 ? 0.5 : 1.0;
    for (int k = i; k >= 0; k--) {
        const double raised = k > 0 ? powers[k - 1] : 0.0;
        const double next = factor * (4.0 * raised - 2.0 * powers[k]) - before[k];
        before[k] = powers[k];
        powers[k] = next;
    }
}

static double larger(double x, double y) {
    return x > y ? x : y;
}

double chebyshev_interpolate(int count, const double values[], double c[]) {
    double coefficients[CHEBYSHEV_LENGTH] = {0.0};
    transform(count, values, coefficients);
    const int last = count - 1;

    double largest = 0.0;
    for (int k = 0; k <= last; k++) {
        largest = larger(fabs(values[k]), largest);
        c[k] = 0.0;
    }
    int degree = last;
    while (degree > 0 && fabs(coefficients[degree]) <= 0x1p-52 * largest) {
        degree--;
    }

    double powers[CHEBYSHEV_LENGTH] = {1.0};
    double before[CHEBYSHEV_LENGTH] = {0.0};
    for (int i = 1; i <= degree; i++) {
        next_powers(i, powers, before);
        for (int k = 1; k <= i; k++) {
            c[k] += coefficients[i] * powers[k];
        }
    }
    c[0] = values[0];
    return larger(fabs(coefficients[last]), fabs(coefficients[last - 1]));
}
