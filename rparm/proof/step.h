/* Sets that contain the states, and steps from one to the next by Lohner's method with a box of
 * high order: README.md has the theorems. */
#pragma once

#include "series.h"

#include <string.h>

#define SMALL     0x1p-100 /* a coefficient that ends the polynomial, */
#define ACCURATE  0x1p-98  /* a remainder that is small enough: in units of the state, */
#define ROUNDED   0x1p-6  /* or of this share of the state: roundings of its value are no smaller */
#define SHARE     0x1p-20 /* or a remainder that is a small part of the hull's radius */
#define NOTHING   0x1p-800 /* what is 0, but for underflow */
#define CLEARLY   1.25     /* by which a set is smaller along sides that have no right angles */
#define ROOM      0x1p-8   /* by which a box is larger than what was estimated */
#define CONFIRMED 0x1p-12  /* room that is left after the check, for another arithmetic */
#define LOOSENED  0x1p-7   /* enlarges derivatives, for the same reason, */
#define ALLOWED   1.0      /* and remainders, which differ more: by other recurrences */

enum { SIDES = 2 * MOST_STATES };

/* The states  centre + sum of c_j side_j  for all |c_j| <= radius_j. The first sides, as many as
 * there are states, are a frame. The others are those of uncertain starts: their c_j are the same
 * ones forever. */
struct states_set {
    struct ball centre[MOST_STATES]; /* without radii */
    int sides; /* as many as states, or twice as many where starts are uncertain */
    double side[SIDES][MOST_STATES];
    double radius[SIDES];
};

/* Why a step cannot be: it may do so at another length. */
enum obstacle { NONE, GROWTH, EVENT, UNDEFINED };

/* A step, and what it claims. */
struct step {
    struct ball begin, length; /* s: its time, and how long it takes */
    double factor;             /* by which to change the length next */
    int more_orders;           /* beyond those that matter for the centre: the box is wider */
    int order;
    enum obstacle obstacle;
    int where; /* of GROWTH the state, of EVENT the guard, of UNDEFINED the node */
    struct ball box[MOST_STATES];       /* contains all motions from the set, over the whole step */
    struct ball hull[MOST_STATES];      /* contains the set at the begin */
    struct ball remainder[MOST_STATES]; /* coefficient order + 1 of all motions from the box */
    struct ball endpoint[MOST_STATES];  /* the Taylor polynomial of the centre at the end */
    struct ball jacobian[MOST_STATES][MOST_STATES]; /* its derivative, anywhere in the hull */
    struct states_set after;
};

/* What steps calculate with. */
struct prover {
    struct model model;
    struct series centre, hull;    /* the box has the centre's, which is done by then */
    struct ball per_order[ORDERS]; /* 1 / k */
    struct step step;
};

/* ---- Sets ----------------------------------------------------------------------------------- */

/* The set of these starts, each of which may be off by a radius. */
static void set_start(struct states_set *set, const struct ball start[], const double radii[],
                      int n) {
    *set = (struct states_set){.sides = n};
    for (int i = 0; i < n; i++) {
        set->centre[i] = ball_midpoint(start[i]);
        set->side[i][i] = set->side[n + i][i] = 1.0;
        set->radius[i] = start[i].radius;
        set->radius[n + i] = radii[i];
        set->sides = radii[i] > 0.0 ? 2 * n : set->sides;
    }
}

/* Balls that contain a set. */
static void set_hull(const struct states_set *set, int n, struct ball hull[]) {
    for (int i = 0; i < n; i++) {
        double radius = 0.0;
        for (int j = 0; j < set->sides; j++) {
            radius += fabs(set->side[j][i]) * set->radius[j];
        }
        for (int j = 0; j < set->sides; j += 16) { // each term adds a rounding
            radius *= OUTWARD;
        }
        hull[i] = ball_widened(set->centre[i], radius + TINY);
    }
}

/* ---- Frames: matrices of columns frame[0] .. [n - 1] ---------------------------------------- */

typedef double vectors_of[MOST_STATES][MOST_STATES];

static double dot(const double x[], const double y[], int n) {
    double sum = 0.0;
    for (int i = 0; i < n; i++) {
        sum += x[i] * y[i];
    }
    return sum;
}

/* x - 2 v (v^T x) / (v^T v) for each of the vectors x */
static void reflect(const double v[], vectors_of vectors, int n) {
    const double square = dot(v, v, n);
    for (int j = 0; j < n && square > 0.0; j++) {
        const double share = 2.0 * dot(v, vectors[j], n) / square;
        for (int i = 0; i < n; i++) {
            vectors[j][i] -= share * v[i];
        }
    }
}

/* Any frame is good; a set is small in one along its longest sides. */
static void frame_along(struct ball sides[][MOST_STATES], const double radius[], int n,
                        vectors_of frame) {
    vectors_of vectors, mirrors = {{0}};
    double lengths[MOST_STATES];
    for (int j = 0; j < n; j++) {
        for (int i = 0; i < n; i++) {
            vectors[j][i] = sides[j][i].hi * radius[j];
            frame[j][i] = i == j ? 1.0 : 0.0;
        }
        lengths[j] = dot(vectors[j], vectors[j], n);
    }
    for (int k = 0; k < n - 1; k++) {
        int longest = 0;
        for (int j = 1; j < n; j++) {
            longest = lengths[j] > lengths[longest] ? j : longest;
        }
        lengths[longest] = -1.0;
        for (int i = k; i < n; i++) {
            mirrors[k][i] = vectors[longest][i];
        }
        const double length = sqrt(dot(mirrors[k], mirrors[k], n));
        mirrors[k][k] += mirrors[k][k] < 0.0 ? -length : length;
        reflect(mirrors[k], vectors, n);
    }
    for (int k = n - 2; k >= 0; k--) {
        reflect(mirrors[k], frame, n);
    }
}

/* An approximate inverse, by Gauss and Jordan; without one, infinite numbers. */
static void invert(vectors_of matrix, int n, vectors_of inverse) {
    vectors_of left;
    for (int j = 0; j < n; j++) {
        for (int i = 0; i < n; i++) {
            left[j][i] = matrix[j][i];
            inverse[j][i] = i == j ? 1.0 : 0.0;
        }
    }
    for (int k = 0; k < n; k++) { // of both, columns are combined
        int pivot = k;
        for (int j = k + 1; j < n; j++) {
            pivot = fabs(left[j][k]) > fabs(left[pivot][k]) ? j : pivot;
        }
        const double divisor = left[pivot][k];
        for (int i = 0; i < n; i++) {
            const double x = left[pivot][i], y = inverse[pivot][i];
            left[pivot][i] = left[k][i];
            inverse[pivot][i] = inverse[k][i];
            left[k][i] = x / divisor;
            inverse[k][i] = y / divisor;
        }
        for (int j = 0; j < n; j++) {
            const double factor = j == k ? 0.0 : left[j][k];
            for (int i = 0; i < n; i++) {
                left[j][i] -= factor * left[k][i];
                inverse[j][i] -= factor * inverse[k][i];
            }
        }
    }
}

/* Bounds of |Q^-1 (sum of c_j side_j + z)| over all |c_j| <= radius_j and |z_i| <= rest_i, which
 * README.md derives. Returns how large the set in these coordinates is, over what is small. */
static double coordinates_in(vectors_of frame, struct ball sides[][MOST_STATES],
                             const double radius[], const double rest[], const double small[],
                             int n, double coordinates[]) {
    static vectors_of inverse; // too large for the stack of every system
    double outward = OUTWARD;  // for every 16 terms: each adds a rounding
    for (int i = 0; i < n; i += 8) {
        outward *= OUTWARD;
    }
    invert(frame, n, inverse);
    double deviation = 0.0, all = 0.0;
    for (int i = 0; i < n; i++) {
        double across[MOST_STATES], sum = 0.0, row = 0.0; // a row of the inverse
        for (int j = 0; j < n; j++) {
            across[j] = inverse[j][i];
        }
        for (int j = 0; j < n; j++) {
            struct ball column[MOST_STATES];
            for (int k = 0; k < n; k++) {
                column[k] = ball_exact(frame[j][k]);
            }
            const struct ball product = ball_dot(across, column, n);
            row += ball_largest(ball_difference(ball_exact(i == j ? 1.0 : 0.0), product));
            sum += ball_largest(ball_dot(across, sides[j], n)) * radius[j];
            sum += fabs(across[j]) * rest[j];
        }
        deviation = fmax(deviation, row * outward);
        coordinates[i] = (sum + TINY) * outward;
        all += coordinates[i];
    }
    const double below_one = (1.0 - deviation) * INWARD;
    const double share = below_one > 0.0 ? deviation / below_one * OUTWARD : (double)INFINITY;
    double largest = 0.0;
    for (int i = 0; i < n; i++) {
        coordinates[i] = (coordinates[i] + share * all * outward) * OUTWARD;
    }
    for (int i = 0; i < n; i++) {
        double reach = 0.0;
        for (int j = 0; j < n; j++) {
            reach += fabs(frame[j][i]) * coordinates[j];
        }
        const double relative = reach / small[i];
        largest = relative <= DBL_MAX ? fmax(largest, relative) : (double)INFINITY;
    }
    return largest;
}

/* ---- Series and box ------------------------------------------------------------------------- */

/* What is small for a state of this size, times `small`. */
static double small_for(struct ball state, double small) {
    return small * fmax(1.0, ROUNDED * ball_largest(state));
}

/* Order 0, also of guards. False: a value is not bounded, and `step` says which. */
static bool begin(struct series *series, const struct ball states[], struct ball time,
                  int directions, struct step *step) {
    const int unbounded = series_begin(series, states, time, directions);
    if (unbounded != NO_NODE) {
        step->obstacle = UNDEFINED;
        step->where = unbounded;
        step->factor = 0.5;
    }
    return unbounded == NO_NODE;
}

/* The Taylor polynomial of the centre: as many orders as change anything. False: there are not as
 * many. */
static bool expand_centre(struct prover *prover, const struct states_set *before) {
    struct step *step = &prover->step;
    struct series *series = &prover->centre;
    if (!begin(series, before->centre, step->begin, 0, step)) {
        return false;
    }
    double size = INFINITY, last = INFINITY; // over what is small
    int k = 0, more = step->more_orders;
    while (k < LAST_ORDER - 1 && (!(size + last <= SMALL) || more-- > 0)) {
        series_extend(series, step->length, ++k, prover->per_order);
        last = size;
        size = 0.0;
        double largest = -1.0;
        for (int i = 0; i < prover->model.states; i++) {
            const struct ball *x = series_row(series, 0, i);
            const double of_state = ball_largest(x[k]) / small_for(x[0], 1.0);
            size += of_state;
            step->where = of_state > largest ? i : step->where;
            largest = fmax(largest, of_state);
        }
    }
    step->order = k;
    for (int i = 0; i < prover->model.states; i++) {
        step->endpoint[i] = series_end(series_row(series, 0, i), k);
    }
    step->obstacle = GROWTH;
    step->factor = 0.875;
    return size <= SMALL;
}

/* False: a guard may be 0 in the box after the begin of the step, and `step` says which. Where it
 * is 0 at the begin, as at a start, its slope is what decides. */
static bool is_guarded(const struct prover *prover, const struct series *box, struct step *step) {
    const struct model *model = &prover->model;
    for (int i = 0; i < model->guards; i++) {
        const struct ball *row = series_row(box, 0, model->guard[i]);
        const struct ball begin = *series_row(&prover->hull, 0, model->guard[i]);
        const struct ball x = ball_largest(begin) <= NOTHING ? row[1] : row[0];
        if (!(ball_smallest(x) > 0.0 && (x.hi > 0.0) == model->positive[i])) {
            step->obstacle = EVENT;
            step->where = i;
            step->factor = 0.5;
            return false;
        }
    }
    return true;
}

/* Finds a box and the remainder over it, if that is small enough, from the series of the hull. */
static bool find_box(struct prover *prover) {
    struct step *step = &prover->step;
    const int n = prover->model.states;
    double reached[MOST_STATES]; // | x_0 + t x_1 + t^2 x_2 ... - middle | over 0 <= t <= 1 is below
    for (int i = 0; i < n; i++) {
        const struct ball *x = series_row(&prover->hull, 0, i);
        const struct ball half = ball_scaled(x[1], 0.5);
        const double middle = x[0].hi + half.hi;
        const struct ball from_there = ball_sum(x[0], half);
        reached[i] = ball_largest(ball_difference(from_there, ball_exact(middle)));
        reached[i] += ball_largest(half);
        for (int k = 2; k <= step->order; k++) {
            reached[i] += ball_largest(x[k]);
        }
        reached[i] *= OUTWARD;
        const double room = small_for(x[0], ACCURATE);
        step->box[i] = ball_around(middle, reached[i] * (1.0 + ROOM) + room);
    }
    struct series *series = &prover->centre; // done
    const struct ball half = ball_scaled(step->length, 0.5);
    const struct ball times = ball_sum(step->begin, ball_widened(half, ball_largest(half)));
    if (!begin(series, step->box, times, 0, step)) {
        return false;
    }
    for (int k = 1; k <= step->order + 1; k++) {
        series_extend(series, step->length, k, prover->per_order);
    }
    if (!is_guarded(prover, series, step)) {
        return false;
    }
    bool inside = true, accurate = true;
    for (int i = 0; i < n; i++) {
        const struct ball last = series_row(series, 0, i)[step->order + 1];
        step->remainder[i] = ball_widened(last, ball_largest(last) * ALLOWED + TINY);
        const double size = ball_largest(step->remainder[i]);
        const double small = small_for(step->hull[i], ACCURATE);
        const bool before = inside && accurate;
        inside = inside && (reached[i] + size) * (1.0 + CONFIRMED) < step->box[i].radius;
        accurate = accurate && (size <= small || size <= SHARE * step->hull[i].radius);
        step->where = before && !(inside && accurate) ? i : step->where;
    }
    const bool more = inside && !accurate && step->order < LAST_ORDER - 1;
    step->obstacle = GROWTH;
    step->factor = more ? 1.0 : inside ? 0.8125 : 0.5;
    step->more_orders += more ? 2 : 0;
    return inside && accurate;
}

/* ---- Steps ---------------------------------------------------------------------------------- */

/* The set at the end. False: what should be finite is not. */
static bool move_set(const struct states_set *before, struct step *step, int n) {
    struct states_set *after = &step->after;
    double rest[MOST_STATES];
    static struct ball axes[MOST_STATES][MOST_STATES]; // too large for the stack of every system
    static vectors_of moved_sides;
    double small[MOST_STATES], moved_radii[MOST_STATES];
    *after = (struct states_set){.sides = before->sides};
    for (int i = 0; i < n; i++) {
        const struct ball end = ball_sum(step->endpoint[i], step->remainder[i]);
        after->centre[i] = ball_midpoint(end);
        small[i] = small_for(end, 1.0);
        rest[i] = end.radius;
        for (int j = 0; j < before->sides; j++) {
            const struct ball moved = ball_dot(before->side[j], step->jacobian[i], n);
            if (j < n) {
                axes[j][i] = moved;
                moved_sides[j][i] = moved.hi;
                continue;
            }
            after->side[j][i] = moved.hi;
            after->radius[j] = before->radius[j];
            const struct ball difference = ball_difference(moved, ball_exact(moved.hi));
            rest[i] = (rest[i] + ball_largest(difference) * before->radius[j]) * OUTWARD;
        }
        rest[i] = (rest[i] + TINY) * OUTWARD;
    }
    // the sides as they are, or right angles: in which of both the set is smaller
    const double as_they_are =
        coordinates_in(moved_sides, axes, before->radius, rest, small, n, moved_radii);
    frame_along(axes, before->radius, n, after->side);
    const double at_right_angles =
        coordinates_in(after->side, axes, before->radius, rest, small, n, after->radius);
    if (CLEARLY * as_they_are < at_right_angles) {
        memcpy(after->side, moved_sides, (size_t)n * sizeof(after->side[0]));
        memcpy(after->radius, moved_radii, (size_t)n * sizeof(double)); // others stay
    }
    bool finite = true;
    for (int i = 0; i < n; i++) {
        finite = finite && ball_largest(after->centre[i]) + after->radius[i] <= DBL_MAX;
    }
    return finite;
}

/* One step at the given times. False: another one may be possible, and `step` says what is in the
 * way. */
static bool take_step(struct prover *prover, const struct states_set *before) {
    struct step *step = &prover->step;
    const int n = prover->model.states;
    if (!expand_centre(prover, before)) {
        return false;
    }
    set_hull(before, n, step->hull);
    if (!begin(&prover->hull, step->hull, step->begin, n, step)) {
        return false;
    }
    for (int k = 1; k <= step->order; k++) {
        series_extend(&prover->hull, step->length, k, prover->per_order);
    }
    if (!find_box(prover)) {
        return false;
    }
    for (int i = 0; i < n; i++) {
        for (int d = 0; d < n; d++) {
            const struct ball x = series_end(series_row(&prover->hull, 1 + d, i), step->order);
            step->jacobian[i][d] = ball_widened(x, x.radius * LOOSENED + 0x1p-80);
        }
    }
    const bool finite = move_set(before, step, n);
    step->more_orders -= step->more_orders > 0 ? 1 : 0;
    step->obstacle = finite ? NONE : GROWTH;
    step->factor = !finite ? 0.5 : step->order < LAST_ORDER - 5 ? 1.25 : 1.0;
    return finite;
}
