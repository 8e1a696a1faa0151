/* Sets that contain the arm's states, and steps from one to the next by Lohner's method with a box
 * of high order: README.md has the theorems. */
#pragma once

#include "arm_series.h"

#define SMALL     0x1p-100 /* a coefficient that ends the polynomial */
#define ACCURATE  0x1p-98  /* a remainder that is small enough, */
#define SHARE     0x1p-20  /* or one that is a small part of the hull's radius */
#define ROOM      0x1p-8   /* by which a box is larger than what was estimated */
#define CONFIRMED 0x1p-12  /* room that is left after the check, for another arithmetic */
#define LOOSENED  0x1p-7   /* enlarges remainders and derivatives, for the same reason */

enum { SIDES = STATES + VARIABLES };

/* The states  centre + sum of c_j side_j  for all |c_j| <= radius_j. The first four sides are a
 * frame. The others are those of uncertain variables: their c_j are the same ones forever. */
struct states_set {
    struct ball centre[STATES]; /* without radii */
    int sides; /* how many there are: 4, and 4 or 12 where variables are uncertain */
    double side[SIDES][STATES];
    double radius[SIDES];
};

/* A step, and what it claims. */
struct arm_step {
    struct step_times times;
    double factor;   /* by which to change the length next */
    int more_orders; /* beyond those that matter for the centre: the box is wider */
    int order;
    struct ball hull[STATES];      /* contains the set at the begin */
    struct ball box[STATES];       /* contains all motions from there, over the whole step */
    struct ball remainder[STATES]; /* coefficient order + 1 of all motions from the box */
    struct ball endpoint[STATES];  /* the Taylor polynomial of the centre at the end */
    struct ball jacobian[STATES][VARIABLES]; /* its derivative, anywhere in the hull */
    double deviation;                        /* row sums of I - Q^T Q, of the frame after */
    struct states_set after;
};

/* ---- Sets ----------------------------------------------------------------------------------- */

/* The first set of a problem whose variables are there. */
static void arm_start(struct arm_problem *problem, struct states_set *set) {
    *set = (struct states_set){.sides = STATES};
    problem->directions = STATES;
    for (int i = 0; i < VARIABLES; i++) {
        const struct ball x = problem->variables[i];
        set->radius[STATES + i] = x.radius;
        if (i < STATES) {
            set->centre[i] = ball_midpoint(x);
            set->side[i][i] = set->side[STATES + i][i] = 1.0;
        } else if (x.radius > 0.0) {
            problem->directions = VARIABLES;
        }
        if (x.radius > 0.0) {
            set->sides = STATES + problem->directions;
        }
    }
}

/* Balls that contain a set. */
static void states_hull(const struct states_set *set, struct ball hull[STATES]) {
    for (int i = 0; i < STATES; i++) {
        double radius = 0.0;
        for (int j = 0; j < set->sides; j++) {
            radius += fabs(set->side[j][i]) * set->radius[j];
        }
        hull[i] = ball_widened(set->centre[i], radius + TINY);
    }
}

/* ---- Frames: matrices, orthogonal but for rounding, of columns frame[0] .. [3] --------------- */

static double dot(const double x[STATES], const double y[STATES]) {
    double sum = 0.0;
    for (int i = 0; i < STATES; i++) {
        sum += x[i] * y[i];
    }
    return sum;
}

/* x - 2 v (v^T x) / (v^T v) for each of the vectors x */
static void reflect(const double v[STATES], double vectors[STATES][STATES]) {
    const double square = dot(v, v);
    for (int j = 0; j < STATES && square > 0.0; j++) {
        const double share = 2.0 * dot(v, vectors[j]) / square;
        for (int i = 0; i < STATES; i++) {
            vectors[j][i] -= share * v[i];
        }
    }
}

/* Any frame is good; a set is small in one along its longest sides. */
static void frame_along(struct ball sides[STATES][STATES], const double radius[STATES],
                        double frame[STATES][STATES]) {
    double vectors[STATES][STATES], lengths[STATES], mirrors[STATES][STATES] = {{0}};
    for (int j = 0; j < STATES; j++) {
        for (int i = 0; i < STATES; i++) {
            vectors[j][i] = sides[j][i].hi * radius[j];
            frame[j][i] = i == j ? 1.0 : 0.0;
        }
        lengths[j] = dot(vectors[j], vectors[j]);
    }
    for (int k = 0; k < STATES - 1; k++) {
        int longest = 0;
        for (int j = 1; j < STATES; j++) {
            longest = lengths[j] > lengths[longest] ? j : longest;
        }
        lengths[longest] = -1.0;
        for (int i = k; i < STATES; i++) {
            mirrors[k][i] = vectors[longest][i];
        }
        const double length = sqrt(dot(mirrors[k], mirrors[k]));
        mirrors[k][k] += mirrors[k][k] < 0.0 ? -length : length;
        reflect(mirrors[k], vectors);
    }
    for (int k = STATES - 2; k >= 0; k--) {
        reflect(mirrors[k], frame);
    }
}

/* Bounds of |Q^-1 (sum of c_j side_j + z)| over all |c_j| <= radius_j and |z_i| <= rest_i, which
 * README.md derives. Returns what is not below the row sums of I - Q^T Q. */
static double coordinates_in(double frame[STATES][STATES], struct ball sides[STATES][STATES],
                             const double radius[STATES], const double rest[STATES],
                             double coordinates[STATES]) {
    double deviation = 0.0, all = 0.0;
    for (int i = 0; i < STATES; i++) {
        struct ball axis[STATES];
        for (int j = 0; j < STATES; j++) {
            axis[j] = ball_exact(frame[i][j]);
        }
        double sum = 0.0;
        for (int j = 0; j < STATES; j++) {
            const struct ball identity = ball_exact(i == j ? 1.0 : 0.0);
            const struct ball product = ball_dot(frame[j], axis, STATES);
            deviation += ball_largest(ball_difference(identity, product));
            sum += ball_largest(ball_dot(frame[i], sides[j], STATES)) * radius[j];
            sum += fabs(frame[i][j]) * rest[j];
        }
        coordinates[i] = (sum + TINY) * OUTWARD;
        all += coordinates[i];
    }
    deviation *= OUTWARD;
    const bool inverts = deviation < 1.0;
    const double share = inverts ? deviation / ((1.0 - deviation) * INWARD) : (double)INFINITY;
    for (int i = 0; i < STATES; i++) {
        coordinates[i] = (coordinates[i] + share * all * OUTWARD) * OUTWARD;
    }
    return deviation;
}

/* ---- Series and box ------------------------------------------------------------------------- */

/* The Taylor polynomial of the centre: as many orders as change anything. False: there are not as
 * many. */
static bool expand_centre(const struct arm_problem *problem, const struct states_set *before,
                          struct ball efforts[EFFORTS][ORDERS], struct arm_step *step) {
    struct arm_series series;
    arm_series_begin(&series, problem, before->centre, true, 0);
    double size = INFINITY, last = INFINITY;
    int k = 0, more = step->more_orders;
    while (k < LAST_ORDER - 1 && (!(size + last <= SMALL) || more-- > 0)) {
        arm_series_extend(&series, step->times.length, efforts, ++k);
        last = size;
        size = 0.0;
        for (int i = 0; i < STATES; i++) {
            size += ball_largest(series.row[i][0][k]);
        }
    }
    step->order = k;
    for (int i = 0; i < STATES; i++) {
        step->endpoint[i] = series_end(series.row[i][0], k);
    }
    return size <= SMALL;
}

/* Finds a box and the remainder over it, if that is small enough. hull: the series of the hull. */
static bool find_box(const struct arm_problem *problem, const struct arm_series *hull,
                     struct arm_step *step) {
    double reached[STATES]; // | x_0 + t x_1 + t^2 x_2 ... - middle | over 0 <= t <= 1 is below
    for (int i = 0; i < STATES; i++) {
        const struct ball *x = hull->row[i][0];
        const struct ball half = ball_scaled(x[1], 0.5);
        const double middle = x[0].hi + half.hi;
        const struct ball from_there = ball_sum(x[0], half);
        reached[i] = ball_largest(ball_difference(from_there, ball_exact(middle)));
        reached[i] += ball_largest(half);
        for (int k = 2; k <= step->order; k++) {
            reached[i] += ball_largest(x[k]);
        }
        reached[i] *= OUTWARD;
        step->box[i] = ball_around(middle, reached[i] * (1.0 + ROOM) + ACCURATE);
    }
    struct arm_series series;
    struct ball efforts[EFFORTS][ORDERS];
    const struct ball half = ball_scaled(step->times.length, 0.5);
    const struct ball whole = ball_widened(half, ball_largest(half));
    arm_efforts(problem, &step->times, whole, efforts);
    arm_series_begin(&series, problem, step->box, false, 0);
    for (int k = 1; k <= step->order + 1; k++) {
        arm_series_extend(&series, step->times.length, efforts, k);
    }
    bool inside = true, accurate = true;
    for (int i = 0; i < STATES; i++) {
        const struct ball last = series.row[i][0][step->order + 1];
        step->remainder[i] = ball_widened(last, ball_largest(last) * LOOSENED + TINY);
        const double size = ball_largest(step->remainder[i]);
        inside = inside && (reached[i] + size) * (1.0 + CONFIRMED) < step->box[i].radius;
        accurate = accurate && (size <= ACCURATE || size <= SHARE * step->hull[i].radius);
    }
    const bool more = inside && !accurate && step->order < LAST_ORDER - 1;
    step->factor = more ? 1.0 : inside ? 0.8125 : 0.5;
    step->more_orders += more ? 2 : 0;
    return inside && accurate;
}

/* ---- Steps ---------------------------------------------------------------------------------- */

/* The set at the end. False: what should be finite is not. */
static bool move_set(const struct states_set *before, struct arm_step *step) {
    struct states_set *after = &step->after;
    double rest[STATES];
    struct ball axes[STATES][STATES];
    *after = (struct states_set){.sides = before->sides};
    for (int i = 0; i < STATES; i++) {
        const struct ball end = ball_sum(step->endpoint[i], step->remainder[i]);
        after->centre[i] = ball_midpoint(end);
        rest[i] = end.radius;
        for (int j = 0; j < before->sides; j++) {
            struct ball moved = ball_dot(before->side[j], step->jacobian[i], STATES);
            if (j < STATES) {
                axes[j][i] = moved;
                continue;
            }
            if (j >= 2 * STATES) { // a parameter's own effect
                moved = ball_sum(moved, step->jacobian[i][j - STATES]);
            }
            after->side[j][i] = moved.hi;
            after->radius[j] = before->radius[j];
            const struct ball difference = ball_difference(moved, ball_exact(moved.hi));
            rest[i] += ball_largest(difference) * before->radius[j];
        }
        rest[i] = (rest[i] + TINY) * OUTWARD;
    }
    frame_along(axes, before->radius, after->side);
    step->deviation = coordinates_in(after->side, axes, before->radius, rest, after->radius);
    bool finite = true;
    for (int i = 0; i < STATES; i++) {
        finite = finite && ball_largest(after->centre[i]) + after->radius[i] <= DBL_MAX;
    }
    return finite;
}

/* One step at the given times. False: another one may go. */
static bool arm_take_step(const struct arm_problem *problem, const struct states_set *before,
                          struct arm_step *step) {
    struct arm_series hull;
    struct ball efforts[EFFORTS][ORDERS];
    arm_efforts(problem, &step->times, ball_exact(0.0), efforts);
    if (!expand_centre(problem, before, efforts, step)) {
        step->factor = 0.875;
        return false;
    }
    states_hull(before, step->hull);
    arm_series_begin(&hull, problem, step->hull, false, problem->directions);
    for (int k = 1; k <= step->order; k++) {
        arm_series_extend(&hull, step->times.length, efforts, k);
    }
    if (!find_box(problem, &hull, step)) {
        return false;
    }
    for (int i = 0; i < STATES; i++) {
        for (int d = 0; d < problem->directions; d++) {
            const struct ball x = series_end(hull.row[i][1 + d], step->order);
            step->jacobian[i][d] = ball_widened(x, x.radius * LOOSENED + 0x1p-80);
        }
    }
    const bool finite = move_set(before, step);
    step->more_orders -= step->more_orders > 0 ? 1 : 0;
    step->factor = !finite ? 0.5 : step->order < LAST_ORDER - 5 ? 1.25 : 1.0;
    return finite;
}
