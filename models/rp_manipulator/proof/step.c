/* A step of Lohner's method with a box of high order: README.md has the theorems. */
#include "step.h"

#define SMALL     0x1p-100 /* a coefficient that ends the polynomial */
#define ACCURATE  0x1p-98  /* a remainder that is small enough, */
#define SHARE     0x1p-20  /* or one that is a small part of the hull's radius */
#define ROOM      0x1p-8   /* by which a box is larger than what was estimated */
#define CONFIRMED 0x1p-12  /* room that is left after the check, for another arithmetic */
#define LOOSENED  0x1p-7   /* enlarges remainders and derivatives, for the same reason */

/* ---- Sets ----------------------------------------------------------------------------------- */

void arm_start(struct arm_problem *problem, struct states_set *set) {
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

void states_hull(const struct states_set *set, struct ball hull[STATES]) {
    for (int i = 0; i < STATES; i++) {
        double radius = 0.0;
        for (int j = 0; j < set->sides; j++) {
            radius += fabs(set->side[j][i]) * set->radius[j];
        }
        hull[i] = ball_widened(set->centre[i], radius + TINY);
    }
}

/* ---- Series --------------------------------------------------------------------------------- */

static void begin(struct arm_series *series, const struct arm_problem *problem,
                  const struct ball states[STATES], bool exact, int directions) {
    struct ball variables[VARIABLES];
    for (int i = 0; i < VARIABLES; i++) {
        const struct ball x = i < STATES ? states[i] : problem->variables[i];
        variables[i] = exact ? ball_midpoint(x) : x;
    }
    arm_series_begin(series, variables, directions);
}

static void efforts_at(const struct effort efforts[EFFORTS], const struct arm_step *step,
                       struct ball after, struct ball series[EFFORTS][ORDERS]) {
    for (int i = 0; i < EFFORTS; i++) {
        effort_series(efforts + i, ball_sum(step->within, after), ball_sum(step->elapsed, after),
                      step->length, series[i]);
    }
}

static double size_of_order(const struct arm_series *series, int k) {
    double size = 0.0;
    for (int i = 0; i < STATES; i++) {
        size += ball_largest(series->row[i][0][k]);
    }
    return size;
}

static struct ball value_at_end(const struct arm_series *series, int state, int direction,
                                int order) {
    const struct ball *coefficients = series->row[state][direction];
    struct ball sum = coefficients[order];
    for (int k = order - 1; k >= 0; k--) {
        sum = ball_sum(sum, coefficients[k]);
    }
    return sum;
}

/* The Taylor polynomial of the centre: as many orders as change anything. Returns the factor by
 * which the step would have to be shorter, 1 if it is short enough. */
static double expand_centre(const struct arm_problem *problem, const struct states_set *before,
                            struct ball efforts[EFFORTS][ORDERS], struct arm_step *step) {
    struct arm_series series;
    begin(&series, problem, before->centre, true, 0);
    double size = INFINITY, last = INFINITY;
    int k = 0, more = step->more_orders;
    while (k < LAST_ORDER - 1 && (!(size + last <= SMALL) || more-- > 0)) {
        arm_series_extend(&series, step->length, efforts, ++k);
        last = size;
        size = size_of_order(&series, k);
    }
    step->order = k;
    for (int i = 0; i < STATES; i++) {
        step->endpoint[i] = value_at_end(&series, i, 0, k);
    }
    double factor = 1.0;
    if (!(size <= DBL_MAX)) {
        return 0x1p-4;
    }
    while (size > SMALL) {
        for (int i = 0; i < k; i++) {
            size *= 0.875;
        }
        factor *= 0.875;
    }
    return factor;
}

/* ---- Box ------------------------------------------------------------------------------------ */

/* Bounds of | x_0 + t x_1 + ... + t^order x_order - middle | over 0 <= t <= 1. */
static double distance(const struct arm_series *series, int state, int order, double middle) {
    const struct ball *x = series->row[state][0];
    const struct ball half = ball_scaled(x[1], 0.5);
    double sum = ball_largest(ball_difference(ball_sum(x[0], half), ball_exact(middle)));
    sum += ball_largest(half);
    for (int k = 2; k <= order; k++) {
        sum += ball_largest(x[k]);
    }
    return sum * OUTWARD;
}

/* Finds a box and the remainder over it. hull: the series of the hull. */
static bool find_box(const struct arm_problem *problem, const struct arm_series *hull,
                     const struct effort efforts[EFFORTS], struct arm_step *step) {
    double reached[STATES];
    for (int i = 0; i < STATES; i++) {
        const double middle = hull->row[i][0][0].hi + 0.5 * hull->row[i][0][1].hi;
        reached[i] = distance(hull, i, step->order, middle);
        step->box[i] = ball_around(middle, reached[i] * (1.0 + ROOM) + ACCURATE);
    }
    struct arm_series series;
    struct ball inputs[EFFORTS][ORDERS];
    const struct ball half = ball_scaled(step->length, 0.5);
    const struct ball whole = ball_widened(half, ball_largest(half));
    efforts_at(efforts, step, whole, inputs);
    begin(&series, problem, step->box, false, 0);
    for (int k = 1; k <= step->order + 1; k++) {
        arm_series_extend(&series, step->length, inputs, k);
    }
    bool inside = true;
    for (int i = 0; i < STATES; i++) {
        const struct ball last = series.row[i][0][step->order + 1];
        const double size = ball_largest(last);
        step->remainder[i] = ball_widened(last, size * LOOSENED + TINY);
        const double all = (reached[i] + ball_largest(step->remainder[i])) * (1.0 + CONFIRMED);
        inside = inside && all < step->box[i].radius;
    }
    return inside;
}

static bool is_accurate(const struct arm_step *step) {
    bool accurate = true;
    for (int i = 0; i < STATES; i++) {
        const double size = ball_largest(step->remainder[i]);
        accurate = accurate && (size <= ACCURATE || size <= SHARE * step->hull[i].radius);
    }
    return accurate;
}

/* ---- The set at the end --------------------------------------------------------------------- */

/* False: what should be finite is not. */
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
    step->deviation = frame_coordinates(after->side, axes, before->radius, rest, after->radius);
    bool finite = true;
    for (int i = 0; i < STATES; i++) {
        finite = finite && ball_is_finite(after->centre[i]) && after->radius[i] <= DBL_MAX;
    }
    return finite;
}

bool arm_take_step(const struct arm_problem *problem, const struct states_set *before,
                   const struct effort efforts[EFFORTS], struct arm_step *step, double *factor) {
    struct arm_series hull;
    struct ball inputs[EFFORTS][ORDERS];
    efforts_at(efforts, step, ball_exact(0.0), inputs);
    *factor = expand_centre(problem, before, inputs, step);
    if (*factor < 1.0) {
        return false;
    }
    states_hull(before, step->hull);
    begin(&hull, problem, step->hull, false, problem->directions);
    for (int k = 1; k <= step->order; k++) {
        arm_series_extend(&hull, step->length, inputs, k);
    }
    if (!find_box(problem, &hull, efforts, step)) {
        *factor = 0.5;
        return false;
    }
    const bool last = step->order >= LAST_ORDER - 1;
    if (!is_accurate(step)) {
        *factor = last ? 0.8125 : 1.0;
        step->more_orders += last ? 0 : 2;
        return false;
    }
    for (int i = 0; i < STATES; i++) {
        for (int d = 0; d < problem->directions; d++) {
            const struct ball x = value_at_end(&hull, i, 1 + d, step->order);
            step->jacobian[i][d] = ball_widened(x, x.radius * LOOSENED + 0x1p-80);
        }
    }
    const bool finite = move_set(before, step);
    step->more_orders -= step->more_orders > 0 ? 1 : 0;
    *factor = !finite ? 0.5 : step->order < LAST_ORDER - 5 ? 1.25 : 1.0;
    return finite;
}
