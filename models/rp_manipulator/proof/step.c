/* A step of Lohner's method with a box of high order: README.md has the theorems. */
#include "step.h"

#include "frame.h"

#define SMALL     0x1p-100 /* a coefficient that ends the polynomial */
#define ACCURATE  0x1p-98  /* a remainder that is small enough, */
#define SHARE     0x1p-20  /* or one that is a small part of the hull's radius */
#define ROOM      0x1p-8   /* by which a box is larger than what was estimated */
#define CONFIRMED 0x1p-12  /* room that is left after the check, for another arithmetic */
#define LOOSENED                                                                                   \
    0x1p-7 /* by which remainders and derivatives are enlarged, for the same reason                \
            */

/* ---- Sets ----------------------------------------------------------------------------------- */

void arm_start(struct arm_problem *problem, struct states_set *set) {
    *set = (struct states_set){0};
    problem->starts = 0;
    problem->uncertain = 0;
    for (int i = 0; i < STATES; i++) {
        set->centre[i] = ball_midpoint(problem->states[i]);
        set->frame[i][i] = 1.0;
        if (problem->states[i].radius > 0.0) {
            const int j = problem->starts++;
            problem->direction[j] = i;
            problem->start_radii[j] = problem->states[i].radius;
            set->spread[i][j] = 1.0;
        }
    }
    for (int i = 0; i < PARAMETERS; i++) {
        if (problem->parameters[i].radius > 0.0) {
            const int j = problem->starts++;
            problem->direction[j] = STATES + problem->uncertain;
            problem->start_radii[j] = problem->parameters[i].radius;
            problem->along[problem->uncertain++] = i;
        }
    }
    set->starts = problem->starts;
}

void states_hull(const struct arm_problem *problem, const struct states_set *set,
                 struct ball hull[STATES]) {
    for (int i = 0; i < STATES; i++) {
        double radius = 0.0;
        for (int j = 0; j < set->starts; j++) {
            radius += fabs(set->spread[i][j]) * problem->start_radii[j];
        }
        for (int j = 0; j < STATES; j++) {
            radius += fabs(set->frame[i][j]) * set->radii[j];
        }
        hull[i] = ball_widened(set->centre[i], radius + TINY);
    }
}

/* ---- Series --------------------------------------------------------------------------------- */

static void begin(struct arm_series *series, const struct arm_problem *problem,
                  const struct ball states[STATES], bool exact, bool derivatives) {
    struct arm_origin origin = {.directions = derivatives ? STATES + problem->uncertain : 0};
    for (int i = 0; i < STATES; i++) {
        origin.states[i] = states[i];
    }
    for (int i = 0; i < PARAMETERS; i++) {
        const struct ball p = problem->parameters[i];
        origin.parameters[i] = exact ? ball_midpoint(p) : p;
        origin.along[i] = problem->along[i];
    }
    arm_series_begin(series, &origin);
}

static void efforts_at(const struct effort efforts[EFFORTS], const struct arm_step *step,
                       struct ball after, int last, struct ball series[EFFORTS][ORDERS]) {
    for (int i = 0; i < EFFORTS; i++) {
        effort_series(efforts + i, ball_sum(step->within, after), ball_sum(step->elapsed, after),
                      step->length, last, series[i]);
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
    begin(&series, problem, before->centre, true, false);
    double size = INFINITY, last = INFINITY;
    int k = 0;
    while (k < LAST_ORDER - 1 && !(size + last <= SMALL)) {
        arm_series_extend(&series, step->length, efforts, ++k);
        last = size;
        size = size_of_order(&series, k);
    }
    for (int more = 0; more < step->more_orders && k < LAST_ORDER - 1; more++) {
        arm_series_extend(&series, step->length, efforts, ++k);
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
    efforts_at(efforts, step, whole, step->order, inputs);
    begin(&series, problem, step->box, false, false);
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

/* The jacobian's part for the states times a column of a matrix. */
static struct ball moved(const struct arm_step *step, int i, const double column[STATES]) {
    struct ball sum = ball_exact(0.0);
    for (int k = 0; k < STATES; k++) {
        sum = ball_sum(sum, ball_times(column[k], step->jacobian[i][k]));
    }
    return sum;
}

/* How coordinate s_j moves state i. */
static struct ball moved_start(const struct arm_problem *problem, const struct states_set *before,
                               const struct arm_step *step, int i, int j) {
    double column[STATES];
    for (int k = 0; k < STATES; k++) {
        column[k] = before->spread[k][j];
    }
    const struct ball by_states = moved(step, i, column);
    const int direction = problem->direction[j];
    return direction < STATES ? by_states : ball_sum(by_states, step->jacobian[i][direction]);
}

/* How coordinate c_j moves state i. */
static struct ball moved_axis(const struct states_set *before, const struct arm_step *step, int i,
                              int j) {
    double column[STATES];
    for (int k = 0; k < STATES; k++) {
        column[k] = before->frame[k][j];
    }
    return moved(step, i, column);
}

static void move_set(const struct arm_problem *problem, const struct states_set *before,
                     struct arm_step *step) {
    struct states_set *after = &step->after;
    double rest[STATES];
    struct ball columns[STATES][STATES];
    *after = (struct states_set){.starts = before->starts};
    for (int i = 0; i < STATES; i++) {
        const struct ball end = ball_sum(step->endpoint[i], step->remainder[i]);
        after->centre[i] = ball_midpoint(end);
        rest[i] = end.radius;
        for (int j = 0; j < before->starts; j++) {
            const struct ball column = moved_start(problem, before, step, i, j);
            after->spread[i][j] = column.hi;
            const struct ball difference = ball_difference(column, ball_exact(column.hi));
            rest[i] += ball_largest(difference) * problem->start_radii[j];
        }
        rest[i] = (rest[i] + TINY) * OUTWARD;
        for (int j = 0; j < STATES; j++) {
            columns[i][j] = moved_axis(before, step, i, j);
        }
    }
    frame_along(columns, before->radii, after->frame);
    step->deviation = frame_coordinates(after->frame, columns, before->radii, rest, after->radii);
}

static bool is_finite(const struct arm_step *step) {
    bool finite = true;
    for (int i = 0; i < STATES; i++) {
        finite = finite && ball_is_finite(step->hull[i]) && ball_is_finite(step->box[i]) &&
                 ball_is_finite(step->endpoint[i]) && ball_is_finite(step->remainder[i]) &&
                 ball_is_finite(step->after.centre[i]) && step->after.radii[i] <= DBL_MAX;
    }
    return finite;
}

enum arm_step_result arm_take_step(const struct arm_problem *problem,
                                   const struct states_set *before,
                                   const struct effort efforts[EFFORTS], struct arm_step *step,
                                   double *factor) {
    struct arm_series hull;
    struct ball inputs[EFFORTS][ORDERS];
    efforts_at(efforts, step, ball_exact(0.0), LAST_ORDER, inputs);
    *factor = expand_centre(problem, before, inputs, step);
    if (*factor < 1.0) {
        return STEP_TOO_LONG;
    }
    states_hull(problem, before, step->hull);
    begin(&hull, problem, step->hull, false, true);
    for (int k = 1; k <= step->order; k++) {
        arm_series_extend(&hull, step->length, inputs, k);
    }
    if (!find_box(problem, &hull, efforts, step)) {
        *factor = 0.5;
        return STEP_TOO_LONG;
    }
    if (!is_accurate(step)) {
        const bool last = step->order == LAST_ORDER - 1;
        *factor = last ? 0.8125 : 1.0;
        step->more_orders += last ? 0 : 2;
        return STEP_TOO_LONG;
    }
    for (int i = 0; i < STATES; i++) {
        for (int d = 0; d < STATES + problem->uncertain; d++) {
            const struct ball x = value_at_end(&hull, i, 1 + d, step->order);
            step->jacobian[i][d] = ball_widened(x, x.radius * LOOSENED + 0x1p-80);
        }
    }
    move_set(problem, before, step);
    *factor = step->order < LAST_ORDER - 5 ? 1.25 : 1.0;
    step->more_orders -= step->more_orders > 0 ? 1 : 0;
    if (!is_finite(step)) {
        *factor = 0.5;
        return STEP_TOO_LONG;
    }
    return STEP_DONE;
}
