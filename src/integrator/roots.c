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

double roots_guess(double offset, double factor, const double c[]) {
    const double c0 = offset + factor * c[0];
    const double c1 = factor * c[1];
    const double c2 = factor * c[2];
    const double square = c1 * c1 - 4.0 * c0 * c2;
    if (!(square >= 0.0) || (c1 > 0.0 && c2 >= 0.0)) {
        return INFINITY;
    }
    return c1 > 0.0 ? (c1 + sqrt(square)) / (-2.0 * c2) : 2.0 * c0 / (sqrt(square) - c1);
}

/* ---- Falls ----------------------------------------------------------------------------------- */

/* Returns the fall to 0 beside s: the first one after it, or the last one up to it. INFINITY if
 * there is none. */
static double fall_beside(const struct roots_polynomial *p, double s, bool is_after) {
    struct root roots[ROOTS_LENGTH];
    const int count = roots_find(p, roots);
    double fall = INFINITY;
    for (int i = 0; i < count && !(is_after ? fall < INFINITY : roots[i].s > s); i++) {
        const bool is_beside = roots[i].kind == ROOT_FALLS && (roots[i].s > s) == is_after;
        fall = is_beside ? roots[i].s : fall;
    }
    return fall;
}

/* True if p is at 0 at s, up to `touch` or its rounding, and turns before it falls farther below;
 * between two roots it turns. */
static bool is_touch(const struct roots_polynomial *p, double s, double touch, bool turns) {
    double value = 0.0;
    double slope = 0.0;
    double half_bend = 0.0;
    double size = 0.0;
    for (int k = p->degree; k >= 0; k--) {
        half_bend = half_bend * s + slope;
        slope = slope * s + value;
        value = value * s + p->c[k];
        size = size * s + fabs(p->c[k]);
    }
    const double depth = fmax(touch, 2.0 * falls_roundings * DBL_EPSILON * size);
    return fabs(value) <= depth &&
           (turns || slope >= 0.0 || slope * slope <= 4.0 * half_bend * (value + depth));
}

/* Within a touch an indicator may be on either side of 0. */
static void disarm(const struct fall *fall) {
    *fall->is_armed = false;
    *fall->noise = fmax(*fall->noise, 2.0 * fall->touch);
}

/* Returns the first s at which p, of an armed indicator, falls to 0, or 1 if it ends there: a touch
 * is no fall. INFINITY if there is neither; if the step ends within a touch, the indicator is no
 * longer armed. */
static double fall_or_end(const struct roots_polynomial *p, const struct fall *fall) {
    struct root roots[ROOTS_LENGTH];
    const int count = roots_find(p, roots);
    for (int i = 0; i < count; i++) {
        const bool is_last = i + 1 == count;
        const double end = is_last ? 1.0 : roots[i + 1].s;
        const double middle = 0.5 * (roots[i].s + end);
        const bool turns =
            is_last ? is_touch(p, end, fall->touch, false) : roots[i + 1].kind == ROOT_RISES;
        const bool falls =
            roots[i].kind == ROOT_FALLS && !(turns && is_touch(p, middle, fall->touch, true));
        if (is_last && turns && !falls) {
            disarm(fall);
            return INFINITY;
        }
        if (falls || roots[i].s == 1.0) {
            return roots[i].s;
        }
    }
    return INFINITY;
}

/* Returns the first s at which p, before on the other side of the level, is beyond it: above if
 * sign is 1, below if it is -1. INFINITY if there is none. */
static double first_beyond(const struct roots_polynomial *p, double level, double sign) {
    double c[ROOTS_LENGTH];
    c[0] = -sign * (p->c[0] - level);
    for (int k = 1; k <= p->degree; k++) {
        c[k] = -sign * p->c[k];
    }
    return roots_first(&(struct roots_polynomial){.c = c, .degree = p->degree, .noise = -1.0});
}

/* True if p rises from the start on until it is above the noise: its slope is half the first one or
 * more as far as s = c1 / (2 sum of k |c_k|). False if that is not known. */
static bool rises_at_once(const struct roots_polynomial *p, double noise) {
    double bend = 0.0;
    for (int k = p->degree; k >= 2; k--) {
        bend += k * fabs(p->c[k]);
    }
    const double slope = p->degree > 0 ? p->c[1] : 0.0;
    const double s = slope < 2.0 * bend ? slope / (2.0 * bend) : 1.0;
    const double margin = 0.5 * (1.0 - 0x1p-40); // more than all rounding
    return slope > 0.0 && p->c[0] + margin * s * slope > noise;
}

/* Returns the first fall of an indicator that is 0 at a restart and is to rise. As long as it is as
 * small as the noise it may have either sign; it has fallen if it is below the noise, and did so
 * when it was 0 last. */
static double first_fall_from_zero(const struct roots_polynomial *p, double noise, bool *is_armed) {
    if (rises_at_once(p, noise)) {
        *is_armed = true;
        return fall_beside(p, 0.0, true);
    }
    const double below = first_beyond(p, -noise, -1.0);
    const double above = first_beyond(p, noise, 1.0);
    if (above < below) {
        *is_armed = true;
        return fall_beside(p, above, true);
    }
    return below == INFINITY ? INFINITY : fmin(below, fall_beside(p, below, false));
}

/* True if p stays above 0 up to s, by the quick proof; p may begin at a root. */
static bool is_above_until(const struct roots_polynomial *p, double s, double noise) {
    double c[ROOTS_LENGTH];
    double power = s;
    c[0] = p->c[0];
    for (int k = 1; k <= p->degree; k++) {
        c[k] = p->c[k] * power;
        power *= s;
    }
    return c[0] >= 0.0 && roots_is_above(&(struct roots_polynomial){c, p->degree, noise});
}

/* An indicator that is below 0 at a restart has not fallen: the modes have just been found valid,
 * and the same event would come again and again. */
double roots_first_fall(const struct roots_polynomial *p, const struct fall *fall) {
    double *noise = fall->noise;
    if (fall->latest <= 1.0 && is_above_until(p, fall->latest, *fall->is_armed ? -1.0 : *noise)) {
        return INFINITY;
    }
    if (p->degree > 0 && p->c[0] <= 0.0 && p->c[1] < 0.0 && is_touch(p, 0.0, fall->touch, false)) {
        disarm(fall);
    }
    if (!*fall->is_armed) {
        double within = fmax(fall->error, *noise);
        if (fall->is_restart && p->c[0] <= -within) {
            within -=
                (1.0 + 0x1p-10) * p->c[0]; // without doubling, fall after fall would lead far below
            *noise = within;
        }
        return first_fall_from_zero(p, within, fall->is_armed);
    }
    // from below 0 it only rises, by the error of the polynomial
    if (p->degree > 0 && p->c[0] <= 0.0 && p->c[1] > 0.0) {
        return fall_beside(p, 0.0, true);
    }
    if (roots_is_above(p)) {
        return INFINITY;
    }
    return p->c[0] > 0.0 ? fall_or_end(p, fall) : roots_search_first(p);
}
