#include "roots.h"

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

NO_FUSED_OPERATIONS

/* ---- Values of a polynomial ----------------------------------------------------------------- */

/* Parts of x = high + low, of 26 digits each, so that products of such parts are exact (Dekker). */
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

/* ---- Chebyshev interpolation ---------------------------------------------------------------- */

enum { LAST = CHEBYSHEV_LENGTH - 1 };

/* Returns cos(k pi / 16). */
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

/* Writes the coefficients of Chebyshev polynomials of 2 s - 1 for the values minus the first value.
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

/* Replaces `powers` by the powers of s in the next Chebyshev polynomial, and `before` by the old
 * powers: T[i] = (4 s - 2) T[i - 1] - T[i - 2], T[1] = (2 s - 1) T[0]. */
static void next_powers(int i, double powers[], double before[]) {
    const double factor = i == 1 ? 0.5 : 1.0;
    for (int k = i; k >= 0; k--) {
        const double raised = k > 0 ? powers[k - 1] : 0.0;
        const double next = factor * (4.0 * raised - 2.0 * powers[k]) - before[k];
        before[k] = powers[k];
        powers[k] = next;
    }
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

/* ---- Polynomials ---------------------------------------------------------------------------- */

/* A polynomial that is above 0 right after s = 0: its first coefficient that is not 0 is above it.
 */
struct rising {
    double c[ROOTS_LENGTH];
    int degree;
};

/* A point; between neighbouring points a polynomial is monotone. */
struct node {
    double s;
    double value;
    int sign;        /* sign of the value: -1, 0, 1 */
    bool is_rounded; /* true if |value| is within the rounding of Horner's scheme */
};

/* Writes p without its roots at s = 0, times a power of 2, so that products neither overflow nor
 * underflow, and times its sign right after s = 0. Returns this sign; 0 if p is 0 or not finite. */
static int prepare(const struct roots_polynomial *p, struct rising *rising) {
    double largest = 0.0;
    for (int k = 0; k <= p->degree; k++) {
        if (!(fabs(p->c[k]) <= DBL_MAX)) {
            return 0;
        }
        largest = larger(fabs(p->c[k]), largest);
    }
    int first = 0;
    while (first <= p->degree && (p->c[first] == 0.0 || fabs(p->c[first]) <= p->noise)) {
        first++;
    }
    if (first > p->degree) {
        return 0;
    }

    double scale = 1.0;
    while (largest * scale > 0x1p500) {
        scale *= 0x1p-500;
    }
    while (largest * scale < 0x1p-500) {
        scale *= 0x1p500;
    }
    const int sign = p->c[first] < 0.0 ? -1 : 1;
    for (int k = first; k <= p->degree; k++) {
        rising->c[k - first] = sign * scale * p->c[k];
    }
    rising->degree = p->degree - first;
    while (rising->degree > 0 && rising->c[rising->degree] == 0.0) {
        rising->degree--;
    }
    return sign;
}

/* Writes the derivative of an order below the degree, over the factorial of the order and with the
 * sign that makes it rise. Its coefficients are rounded once. */
static void differentiate(const struct rising *p, int order, struct rising *derivative) {
    double binomial = 1.0; // order + k over k
    int sign = 0;
    for (int k = 0; k <= p->degree - order; k++) {
        const double coefficient = binomial * p->c[k + order];
        if (sign == 0 && coefficient != 0.0) {
            sign = coefficient < 0.0 ? -1 : 1;
        }
        derivative->c[k] = sign * coefficient;
        binomial = binomial * (order + k + 1) / (k + 1);
    }
    derivative->degree = p->degree - order;
}

/* ---- How many roots ------------------------------------------------------------------------- */

/* Indices of a polynomial a little below p and of one a little above, by more than all rounding
 * here and in Horner's scheme. Their coefficients lie side by side: the processor adds both at
 * once. */
enum { BELOW, ABOVE, BOUNDS };

/* Replaces coefficients of s^k by coefficients of s^k (1 - s)^(degree - k), which are the
 * coefficients of x^degree p(1 / x) with x + 1 for x. */
static void move_to_ends(double c[ROOTS_LENGTH][BOUNDS], int degree) {
    for (int i = 0; i < degree; i++) {
        double below = c[0][BELOW];
        double above = c[0][ABOVE];
        for (int k = 1; k <= degree - i; k++) {
            below += c[k][BELOW];
            above += c[k][ABOVE];
            c[k][BELOW] = below;
            c[k][ABOVE] = above;
        }
    }
}

/* Writes both bounds as coefficients of s^k (1 - s)^(degree - k). */
static void bound(const struct rising *p, double bounds[ROOTS_LENGTH][BOUNDS]) {
    const double slack = 0x1p-45;
    for (int k = 0; k <= p->degree; k++) {
        bounds[k][BELOW] = p->c[k] - slack * fabs(p->c[k]);
        bounds[k][ABOVE] = p->c[k] + slack * fabs(p->c[k]);
    }
    move_to_ends(bounds, p->degree);
}

/* True if p is monotone on (0, 1]: the first coefficient behind c[0] outweighs, in the derivative,
 * all coefficients of the other sign. Writes the sign of the slope. False if that is not known. */
static bool is_monotone(const struct rising *p, int *slope) {
    int first = 1;
    while (first < p->degree && p->c[first] == 0.0) {
        first++;
    }
    *slope = first <= p->degree && p->c[first] < 0.0 ? -1 : 1;
    double against = 0.0;
    for (int k = first + 1; k <= p->degree; k++) {
        const double term = -*slope * p->c[k];
        against += term > 0.0 ? k * term : 0.0;
    }
    const double slack = 0x1p-40; // more than all rounding
    return first <= p->degree && (1.0 - slack) * first * fabs(p->c[first]) > against;
}

/* Returns the largest possible number of roots of p on (0, 1], by Descartes' rule if p is not
 * monotone. With 0 or 1, p is otherwise beyond its rounding, except perhaps for its value at 1; 2
 * stands for two or more. */
static int most_roots(const struct rising *p) {
    int slope;
    if (is_monotone(p, &slope)) {
        return slope > 0 ? 0 : 1;
    }
    double c[ROOTS_LENGTH][BOUNDS];
    bound(p, c);
    int positive = 0;
    while (positive <= p->degree && c[positive][BELOW] > 0.0) {
        positive++;
    }
    if (positive > p->degree) {
        return 0;
    }

    int changes = 0;
    int unknown = 0; // number of signs since the last known sign
    int sign = 1;
    for (int k = positive; k <= p->degree; k++) {
        if (c[k][ABOVE] < 0.0 || c[k][BELOW] > 0.0) {
            const int next = c[k][ABOVE] < 0.0 ? -1 : 1;
            changes += next != sign;
            if (unknown > (next != sign)) {
                return 2;
            }
            unknown = 0;
            sign = next;
        } else if (c[k][ABOVE] != 0.0 || c[k][BELOW] != 0.0) {
            unknown++;
        }
    }
    return unknown > 1 - changes ? 2 : changes + unknown;
}

/* ---- Roots of monotone pieces --------------------------------------------------------------- */

/* Returns the bits of s: doubles >= 0 have the order of their bits. */
static uint64_t bits_of(double s) {
    uint64_t bits;
    memcpy(&bits, &s, sizeof bits);
    return bits;
}

static double with_bits(uint64_t bits) {
    double s;
    memcpy(&s, &bits, sizeof s);
    return s;
}

/* Evaluates p at s. is_exact: the sign is exact; otherwise it is 0 within the rounding. */
static struct node node_at(const struct rising *p, double s, bool is_exact, double *slope) {
    const struct horner_value at = horner(p->c, p->degree, s);
    *slope = at.slope;
    struct node node = {s, at.value, 0, fabs(at.value) <= at.rounding};
    if (node.is_rounded) {
        node.value = is_exact ? horner_compensated(p->c, p->degree, s) : 0.0;
    }
    node.sign = (node.value > 0.0) - (node.value < 0.0);
    return node;
}

/* Returns a double between two that are no neighbours. */
static double middle(double low, double high) {
    const double s = low < 0.0625 * high ? 0.0625 * high : 0.5 * (low + high);
    return s > low && s < high ? s : with_bits((bits_of(low) + bits_of(high)) / 2);
}

/* Returns the first s at which p, monotone between two nodes of opposite sign, no longer has the
 * sign of the lower one. Uses Newton's method as long as its steps become shorter, otherwise
 * bisection. Steps of few units in the last place are lengthened to pass the root, so that it is
 * soon between neighbours. */
static double crossing(const struct rising *p, struct node low, struct node high, bool is_exact) {
    double step = high.s - low.s;
    double s = low.s + step * (low.value / (low.value - high.value));
    if (low.s == 0.0 && p->degree > 0) { // the root of the parabola with the slope there
        const double bend = (high.value - low.value - p->c[1] * step) / (step * step);
        s = 2.0 * low.value / (sqrt(p->c[1] * p->c[1] - 4.0 * bend * low.value) - p->c[1]);
    }
    uint64_t least = 1; // units in the last place
    while (bits_of(high.s) - bits_of(low.s) > 1) {
        if (!(s > low.s && s < high.s)) {
            s = middle(low.s, high.s);
            step = high.s - low.s;
        }
        double slope;
        const struct node node = node_at(p, s, is_exact, &slope);
        if (node.sign == 0) {
            return s;
        }
        const bool is_low = node.sign == low.sign;
        *(is_low ? &low : &high) = node;
        const double next = s - node.value / slope;
        const double way = fabs(next - s);
        if (way <= (double)least * (with_bits(bits_of(s) + 1) - s)) {
            s = with_bits(is_low ? bits_of(s) + least : bits_of(s) - least);
            least = least < UINT64_C(1) << 40 ? 2 * least : least;
        } else {
            s = way <= 0.25 * step ? next : -1.0;
        }
        step = way;
    }
    return high.s;
}

/* ---- All pieces ----------------------------------------------------------------------------- */

/* Replaces the count points at which the derivative changes its sign by the points at which p does,
 * or is within its rounding, all of them inside (0, 1). Returns their number. */
static int replace_points(const struct rising *p, double points[ROOTS_LENGTH], int count) {
    struct node left = {0.0, p->c[0], 1, false};
    int found = 0;
    points[count] = 1.0;
    for (int i = 0; i <= count; i++) {
        double slope;
        const struct node right = node_at(p, points[i], false, &slope);
        double s = 1.0;
        if (right.sign == 0) {
            s = right.s;
        } else if (left.sign == -right.sign) {
            s = crossing(p, left, right, false);
        }
        if (s < 1.0) {
            points[found] = s;
            found++;
        }
        left = right;
    }
    return found;
}

/* Writes points between which p is monotone, in their order inside (0, 1). Returns their number. */
static int find_extrema(const struct rising *p, double points[ROOTS_LENGTH]) {
    // up to the first derivative with one root at most
    struct rising derivative;
    int order = 0;
    do {
        order++;
        differentiate(p, order, &derivative);
    } while (most_roots(&derivative) > 1);
    // and down again
    int count = replace_points(&derivative, points, 0);
    for (order--; order > 0; order--) {
        differentiate(p, order, &derivative);
        count = replace_points(&derivative, points, count);
    }
    return count;
}

/* Writes the first `most` roots (1 or ROOTS_LENGTH) of p, which is rising or, if sign is -1, its
 * opposite. Returns their number. */
static int find(const struct rising *p, int sign, int most, struct root roots[ROOTS_LENGTH]) {
    double points[ROOTS_LENGTH];
    const int expected = most_roots(p);
    if (expected == 0) {
        return 0;
    }
    const int count = expected == 1 ? 0 : find_extrema(p, points);
    const enum root_kind across[] = {sign > 0 ? ROOT_FALLS : ROOT_RISES,
                                     sign > 0 ? ROOT_RISES : ROOT_FALLS};

    struct node left = {0.0, p->c[0], 1, false};
    int now = 1;          // the last sign that is not 0
    bool is_open = false; // true if the last root may still turn out to be a crossing
    int found = 0;
    points[count] = 1.0;
    for (int i = 0; i <= count && (found < most || is_open); i++) {
        double slope;
        const struct node right = node_at(p, points[i], true, &slope);
        if (right.sign == -now) {
            found += !is_open;
            const double s = left.sign == 0 ? left.s : crossing(p, left, right, true);
            roots[found - 1] = (struct root){s, across[now < 0]};
            is_open = false;
            now = right.sign;
        } else if (!right.is_rounded) {
            is_open = false;
        } else if (!left.is_rounded) {
            roots[found] = (struct root){right.s, ROOT_TOUCHES};
            found++;
            is_open = true;
        }
        left = right;
    }
    if (is_open && left.sign == 0) {
        roots[found - 1] = (struct root){1.0, across[now < 0]};
    }
    return found;
}

/* ---- Interface ------------------------------------------------------------------------------ */

int roots_find(const struct roots_polynomial *p, struct root roots[ROOTS_LENGTH]) {
    struct rising rising;
    const int sign = prepare(p, &rising);
    return sign == 0 ? 0 : find(&rising, sign, ROOTS_LENGTH, roots);
}

double roots_search_first(const struct roots_polynomial *p) {
    struct rising rising;
    struct root roots[ROOTS_LENGTH];
    const int sign = prepare(p, &rising);
    if (sign < 0 || (p->noise < 0.0 && p->c[0] == 0.0)) {
        return 0.0;
    }
    return sign > 0 && find(&rising, 1, 1, roots) > 0 ? roots[0].s : INFINITY;
}
