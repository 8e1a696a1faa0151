#include "falls.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* The last fall to 0 up to this s; INFINITY: there is none. */
static double last_fall(const struct roots_polynomial *p, double s) {
    struct root roots[ROOTS_LENGTH];
    const int count = roots_find(p, roots);
    double last = INFINITY;
    for (int i = 0; i < count && roots[i].s <= s; i++) {
        last = roots[i].kind == ROOT_FALLS ? roots[i].s : last;
    }
    return last;
}

/* The first fall to 0 behind this s; INFINITY: there is none. */
static double fall_behind(const struct roots_polynomial *p, double s) {
    struct root roots[ROOTS_LENGTH];
    const int count = roots_find(p, roots);
    for (int i = 0; i < count; i++) {
        if (roots[i].s > s && roots[i].kind == ROOT_FALLS) {
            return roots[i].s;
        }
    }
    return INFINITY;
}

/* Between two roots, p is no farther from 0 than this or the rounding of its coefficients. */
static bool is_touch(const struct roots_polynomial *p, double begin, double end, double touch) {
    const double s = 0.5 * (begin + end);
    double value = 0.0;
    double size = 0.0;
    for (int k = p->degree; k >= 0; k--) {
        value = value * s + p->c[k];
        size = size * s + fabs(p->c[k]);
    }
    return fabs(value) <= fmax(touch, 16.0 * DBL_EPSILON * size);
}

/* The first s at which p falls to 0, or 1 if it ends there: a touch is no fall. INFINITY: neither.
 */
static double fall_or_end(const struct roots_polynomial *p, double touch) {
    struct root roots[ROOTS_LENGTH];
    const int count = roots_find(p, roots);
    for (int i = 0; i < count; i++) {
        const bool rises_again = i + 1 < count && roots[i + 1].kind == ROOT_RISES;
        const bool falls = roots[i].kind == ROOT_FALLS &&
                           !(rises_again && is_touch(p, roots[i].s, roots[i + 1].s, touch));
        if (falls || roots[i].s == 1.0) {
            return roots[i].s;
        }
    }
    return INFINITY;
}

/* The first s at which p, below the level before, is above it; INFINITY: it stays below. */
static double first_rise(const struct roots_polynomial *p, double level) {
    double c[ROOTS_LENGTH];
    c[0] = level - p->c[0];
    for (int k = 1; k <= p->degree; k++) {
        c[k] = -p->c[k];
    }
    const struct roots_polynomial below = {.c = c, .degree = p->degree, .noise = -1.0};
    return roots_first(&below);
}

/* The first s at which p is below the level; INFINITY: it stays above. */
static double first_below(const struct roots_polynomial *p, double level) {
    double c[ROOTS_LENGTH];
    memcpy(c, p->c, ((size_t)p->degree + 1) * sizeof *c);
    c[0] -= level;
    const struct roots_polynomial above = {.c = c, .degree = p->degree, .noise = -1.0};
    return roots_first(&above);
}

/* p rises from the start on until it is above the noise: its slope is half the first one or more as
 * far as s = c1 / (2 sum of k |c_k|). False: that is not known. */
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

/* The first fall of an indicator that is 0 at a restart and is to rise. As small as the noise it
 * may have either sign; it has fallen where it is below the noise, and did so where it was 0 last.
 */
static double first_fall_from_zero(const struct roots_polynomial *p, double noise, bool *is_armed) {
    if (rises_at_once(p, noise)) {
        *is_armed = true;
        return fall_behind(p, 0.0);
    }
    const double below = first_below(p, -noise);
    const double above = first_rise(p, noise);
    if (above < below) {
        *is_armed = true;
        return fall_behind(p, above);
    }
    return below == INFINITY ? INFINITY : fmin(below, last_fall(p, below));
}

/* p stays above 0 up to s, by the quick proof; from its start on, where it may be at a root. */
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
 * and one event would come again and again. */
double fall_first(const struct roots_polynomial *p, const struct fall *fall) {
    double *noise = fall->noise;
    const bool is_armed = *fall->is_armed;
    if (fall->latest <= 1.0 && is_above_until(p, fall->latest, is_armed ? -1.0 : *noise)) {
        return INFINITY;
    }
    if (!is_armed) {
        double within = fmax(fall->error, *noise);
        if (fall->is_restart && p->c[0] <= -within) {
            within -= (1.0 + 0x1p-10) * p->c[0]; // doubled, fall after fall would lead far below
            *noise = within;
        }
        return first_fall_from_zero(p, within, fall->is_armed);
    }
    // from below 0 it can only rise by the error of the polynomial
    const bool rises = p->degree > 0 && p->c[0] <= 0.0 && p->c[1] > 0.0;
    if (rises) {
        return fall_behind(p, 0.0);
    }
    const double s = roots_first(p);
    return s > 0.0 && s < 1.0 ? fall_or_end(p, fall->touch) : s;
}
