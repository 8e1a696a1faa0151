#include "falls.h"

#include <float.h>
#include <math.h>

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
double fall_first(const struct roots_polynomial *p, const struct fall *fall) {
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
