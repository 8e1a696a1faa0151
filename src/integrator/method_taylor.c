/* Steps by the Taylor series of the solution (Jorba and Zou, A software package for the numerical
 * integration of ODEs by means of high-order Taylor methods, Experimental Mathematics 14, 2005).
 *
 * The time scale of a series is the way to the requested time. Orders are added until the terms
 * one time scale ahead are within the tolerance; the step lands there, and the state is the sum of
 * the coefficients. Where the largest order is not enough, a step is as long as this order allows.
 * At its end the polynomial must fit the equations.
 *
 * Where a restart goes on along the solution, its first step has the largest order and all the
 * length that this allows. The requested times in it are values of one polynomial. */
#include "method.h"
#include "workspace.h"

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* The last coefficient of an input enters the states' two orders before. */
enum { LEAST_ORDER = SERIES_INPUT_LENGTH + 1 };

/* Of the length that the last terms allow (Jorba and Zou, section 3.2.1). */
static const double safety = 0.9;

/* Units of the longest step that goes past requested times: terms that are needed for one much
 * longer may have underflowed. */
static const double most_scales = 1000.0;

/* The next time scale over the one before: where a term overflows, and in the step after that. */
static const double shrinking = 0x1p-20;
static const double growing = 16.0;

struct taylor {
    struct problem *problem;
    int largest_order;
    double begin;         /* of the series, s since the restart */
    double time_scale;    /* of its coefficients, s */
    bool is_searched;     /* for events, since the restart */
    double longest_scale; /* s: of the next step of the running advance */
    int order;
    int noted_order;    /* the largest whose size is noted */
    int expected_order; /* of the next step that lands; what it gives does not depend on it */
    double last_length; /* s: of the last step, or the one that a restart gave; 0: none */
    double passed;      /* s since the restart: where the step ended that goes past requested times;
                           -INFINITY: there is none */
    double size[SERIES_LENGTH]; /* of the terms of each order from 1 on */
    double *weight;             /* of each state: 1 over its tolerance */
    double (*row)[SERIES_LENGTH];
    double (*end_row)[SERIES_LENGTH]; /* orders 0 and 1 at the end of a step */
    double *end_x;                    /* the state there */
    double *end_dx; /* the derivative of the polynomial there, by s, which counts time scales */
};

/* ---- Life ----------------------------------------------------------------------------------- */

static size_t memory_size(const struct ode *ode) {
    const size_t padding = 5 * _Alignof(max_align_t);
    return sizeof(struct taylor) + padding + 3 * ode->state_count * sizeof(double) +
           2 * ode->series_row_count * sizeof(double[SERIES_LENGTH]);
}

static void destroy(void *memory) {
    struct taylor *taylor = memory;
    workspace_free(taylor->end_row);
    workspace_free(taylor->row);
    workspace_free(taylor->weight);
    workspace_free(taylor);
}

static enum status create(struct problem *problem, void **memory) {
    *memory = NULL;
    struct taylor *taylor = workspace_calloc(1, sizeof *taylor);
    if (taylor == NULL) {
        return STATUS_OUT_OF_MEMORY;
    }
    taylor->problem = problem;
    const size_t n = problem->ode.state_count;
    taylor->weight = workspace_calloc(3 * n, sizeof *taylor->weight);
    taylor->row = workspace_calloc(problem->ode.series_row_count, sizeof *taylor->row);
    taylor->end_row = workspace_calloc(problem->ode.series_row_count, sizeof *taylor->end_row);
    if (taylor->weight == NULL || taylor->row == NULL || taylor->end_row == NULL) {
        destroy(taylor);
        return STATUS_OUT_OF_MEMORY;
    }
    taylor->end_x = taylor->weight + n;
    taylor->end_dx = taylor->weight + 2 * n;
    *memory = taylor;
    return STATUS_OK;
}

/* Steps cost least near 1 - ln(tolerance) / 2 where all orders cost the same (Jorba and Zou,
 * section 3.2). The first ones, with their sine and cosine, cost as much as several others. */
static enum status configure(void *memory) {
    struct taylor *taylor = memory;
    const double e = 2.718281828459045;
    int order = 8; // at a tolerance of 1
    for (double left = taylor->problem->settings.relative_tolerance;
         left < 1.0 && order < SERIES_LENGTH - 1; left *= e * e) {
        order++;
    }
    taylor->largest_order = order + 1 - order % 2;
    taylor->expected_order = LEAST_ORDER;
    return STATUS_OK;
}

static enum status restart(void *memory, const double x[]) {
    struct taylor *taylor = memory;
    taylor->passed = -INFINITY;
    taylor->is_searched = location_is_active(&taylor->problem->location);
    taylor->last_length = taylor->problem->first_step;
    return STATUS_OK;
}

/* ---- Series --------------------------------------------------------------------------------- */

/* Begins the series at the state x, with the orders from 0 to last. */
static enum status begin_series(struct taylor *taylor, double t, double time_scale,
                                const double x[], int last) {
    const struct integrator_settings *settings = &taylor->problem->settings;
    for (size_t i = 0; i < taylor->problem->ode.state_count; i++) {
        taylor->row[i][0] = x[i];
        taylor->weight[i] =
            1.0 / (settings->relative_tolerance * fabs(x[i]) + settings->absolute_tolerances[i]);
    }
    taylor->begin = t;
    taylor->time_scale = time_scale;
    taylor->order = last;
    taylor->noted_order = 0;
    return problem_series(taylor->problem, t, time_scale, 0, last, taylor->row);
}

/* Goes on with the series, to the order last. */
static enum status add_orders(struct taylor *taylor, int last) {
    const int first = taylor->order + 1;
    taylor->order = last;
    return problem_series(taylor->problem, taylor->begin, taylor->time_scale, first, last,
                          taylor->row);
}

/* Sum of the terms of an order, one time scale ahead, in tolerances of the states. */
static double size_of_terms(const struct taylor *taylor, int order) {
    double size = 0.0;
    for (size_t i = 0; i < taylor->problem->ode.state_count; i++) {
        size += fabs(taylor->row[i][order]) * taylor->weight[i];
    }
    return size;
}

/* Notes the sizes of the orders to this last one. */
static void note_sizes(struct taylor *taylor, int last) {
    for (int k = taylor->noted_order + 1; k <= last; k++) {
        taylor->size[k] = size_of_terms(taylor, k);
    }
    taylor->noted_order = last;
}

/* The terms of two orders, one time scale ahead, are within the tolerance and become smaller. */
static bool has_converged(const struct taylor *taylor, int order) {
    return taylor->size[order - 1] <= 1.0 && taylor->size[order] <= taylor->size[order - 1];
}

/* Near log2 x, for x >= 0. */
static int exponent_of(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (int)(bits >> 52) - 1023;
}

/* The length of a step, in time scales, at whose end the terms of the last two orders are within
 * the tolerance, and the bound at most; NaN where a term is not finite. */
static double step_of_last_terms(const struct taylor *taylor, double bound) {
    const int last = taylor->order;
    const double *size = taylor->size;
    if (!isfinite(size[last - 1] + size[last])) {
        return NAN;
    }
    // where log2 of the size over the order is larger
    const bool is_last = exponent_of(size[last]) * (last - 1) > exponent_of(size[last - 1]) * last;
    const int limiting = is_last ? last : last - 1;
    const double step = safety * pow(size[limiting], -1.0 / limiting);
    return step < bound ? step : bound;
}

/* Looks for the order at which the series has converged and adds orders to find it: odd ones,
 * because with steps of even order the errors of a swing cancel, and cease to cancel at a smaller
 * tolerance where some steps have one order more. Writes the length of the step, in time scales: 1,
 * or what the largest order allows, 1 at most; NaN as above. */
static enum status find_order(struct taylor *taylor, double *step) {
    for (int order = LEAST_ORDER;; order += 2) {
        if (order > taylor->order) {
            const enum status status = add_orders(taylor, order);
            if (status != STATUS_OK) {
                return status;
            }
        }
        note_sizes(taylor, order);
        const bool is_enough = has_converged(taylor, order);
        if (is_enough || order == taylor->largest_order) {
            taylor->order = order;
            *step = is_enough ? 1.0 : step_of_last_terms(taylor, 1.0);
            return STATUS_OK;
        }
    }
}

/* The state at begin + s * time_scale and, unless NULL, its derivative by s. n: the number of
 * states. */
ALWAYS_INLINE void evaluate_of(const struct taylor *taylor, double s, size_t n, double x[],
                               double dx[]) {
    for (size_t i = 0; i < n; i++) {
        x[i] = taylor->row[i][taylor->order];
        if (dx != NULL) {
            dx[i] = 0.0;
        }
    }
    for (int k = taylor->order - 1; k >= 0; k--) {
        for (size_t i = 0; i < n; i++) {
            if (dx != NULL) {
                dx[i] = dx[i] * s + x[i];
            }
            x[i] = x[i] * s + taylor->row[i][k];
        }
    }
}

/* Where the number of states is a constant, and s = 1 is one, values stay in registers and the
 * products are left out: a quarter of a step of two joints. */
static void evaluate(const struct taylor *taylor, double s, double x[], double dx[]) {
    double four_x[4];
    double four_dx[4];
    const size_t n = taylor->problem->ode.state_count;
    if (n != 4) {
        evaluate_of(taylor, s, n, x, dx);
        return;
    }
    if (dx == NULL) {
        evaluate_of(taylor, s, 4, four_x, NULL);
    } else if (s == 1.0) {
        evaluate_of(taylor, 1.0, 4, four_x, four_dx);
    } else {
        evaluate_of(taylor, s, 4, four_x, four_dx);
    }
    for (int i = 0; i < 4; i++) {
        x[i] = four_x[i];
    }
    if (dx != NULL) {
        for (int i = 0; i < 4; i++) {
            dx[i] = four_dx[i];
        }
    }
}

/* ---- Check ---------------------------------------------------------------------------------- */

/* Writes the state at begin + s * time_scale to end_x, and by how much the polynomial misses the
 * equations there: the difference of its derivative from theirs, in tolerances per step. That is
 * about the order of the first term left out times its size. Small terms prove nothing, because
 * orders of a series may vanish: a motion from rest can have the orders 3, 4, 11, 12, 19 ... and
 * none between.
 */
static enum status measure_defect(struct taylor *taylor, double s, double *defect) {
    const size_t n = taylor->problem->ode.state_count;
    evaluate(taylor, s, taylor->end_x, taylor->end_dx);
    for (size_t i = 0; i < n; i++) {
        taylor->end_row[i][0] = taylor->end_x[i];
    }
    const enum status status =
        problem_series(taylor->problem, taylor->begin + s * taylor->time_scale, taylor->time_scale,
                       0, 1, taylor->end_row);
    if (status != STATUS_OK) {
        return status;
    }
    *defect = 0.0;
    for (size_t i = 0; i < n; i++) {
        const double derivative = taylor->end_dx[i];
        const double rounding = 64.0 * DBL_EPSILON * fabs(derivative);
        const double missed = fabs(taylor->end_row[i][1] - derivative) - rounding;
        *defect += missed <= 0.0 ? 0.0 : s * missed * taylor->weight[i];
    }
    return STATUS_OK;
}

/* Adds orders until the polynomial fits the equations at the end of the step, or shortens it. */
static enum status fit_step(struct taylor *taylor, bool is_long, double *step,
                            struct method_work *work) {
    for (;;) {
        double defect;
        enum status status = measure_defect(taylor, *step, &defect);
        if (status != STATUS_OK || defect <= taylor->order + 1) {
            return status;
        }
        if (*step == 1.0 && !is_long && taylor->order < taylor->largest_order) {
            status = add_orders(taylor, taylor->order + 2);
            if (status != STATUS_OK) {
                return status;
            }
        } else if (taylor->begin + 0.5 * *step * taylor->time_scale > taylor->begin) {
            *step *= 0.5;
            work->failed_steps++;
        } else {
            return isfinite(defect) ? STATUS_NO_CONVERGENCE : STATUS_NOT_FINITE;
        }
    }
}

/* ---- Steps ---------------------------------------------------------------------------------- */

/* Longest step from the time t on, s. */
static double longest_step(const struct problem *problem, double t) {
    const double max_step = problem->settings.max_step;
    const double left = problem->horizon - t;
    return max_step > 0.0 && max_step < left ? max_step : left;
}

static double longest_step_in_scales(const struct problem *problem, double t, double time_scale) {
    const double longest = longest_step(problem, t) / time_scale;
    const double most = location_is_active(&problem->location) ? growing : most_scales;
    return longest < most ? longest : most;
}

/* Begins the series of a step at the state x, the orders of which depend on is_long; writes the
 * length of the step in time scales. */
static enum status expand_with_scale(struct taylor *taylor, double time_scale, double t,
                                     bool is_long, const double x[], double *step) {
    const int first_orders = is_long ? taylor->largest_order : taylor->expected_order;
    const enum status status = begin_series(taylor, t, time_scale, x, first_orders);
    if (status != STATUS_OK || !is_long) {
        return status != STATUS_OK ? status : find_order(taylor, step);
    }
    note_sizes(taylor, taylor->order);
    *step = step_of_last_terms(taylor, longest_step_in_scales(taylor->problem, t, time_scale));
    return STATUS_OK;
}

/* Expands the solution about the state x at the time t. is_long: for a step as long as possible;
 * otherwise for one of `length` (s) at most, which is the time scale unless terms overflow. Writes
 * the length of the step in time scales. */
static enum status expand(struct taylor *taylor, double t, double length, bool is_long,
                          const double x[], double *step, struct method_work *work) {
    const double first = taylor->longest_scale < length ? taylor->longest_scale : length;
    for (double time_scale = first; time_scale >= DBL_MIN; time_scale *= shrinking) {
        const enum status status = expand_with_scale(taylor, time_scale, t, is_long, x, step);
        if (status != STATUS_OK || !isnan(*step)) {
            // the next step need not begin from the whole length again
            taylor->longest_scale = time_scale < length ? growing * time_scale : INFINITY;
            return status;
        }
        work->failed_steps++;
    }
    return STATUS_NOT_FINITE;
}

/* The shortest step that a way shortens, over the time since the restart. */
static const double resolution = 0x1p-40;

/* A step (in time scales) in which no state moves farther from x, where it begins, than it may. */
static double step_within_reach(struct taylor *taylor, const double x[], double step) {
    const struct ode *ode = &taylor->problem->ode;
    if (!taylor->is_searched || ode->reach == NULL) {
        return step;
    }
    double *reach = taylor->problem->location.dx;
    ode->reach(x, reach, ode->context);
    double within = step;
    for (size_t i = 0; i < ode->state_count; i++) {
        double way = 0.0;
        for (int k = taylor->order; k >= 1 && reach[i] < INFINITY; k--) {
            way = (way + fabs(taylor->row[i][k])) * step;
        }
        if (way > reach[i]) {
            // the way grows at least in proportion to the step
            within = fmin(within, step * (reach[i] / way));
        }
    }
    if (within == step) {
        return step;
    }
    const double shortest = resolution * taylor->begin / taylor->time_scale;
    return fmax(within, fmin(step, shortest));
}

/* s: where no step was before. */
static const double first_length = 1e-3;

/* Length that a step from now towards t is expanded for, s. With events, long steps must not depend
 * on t: there it is the length of the step before. */
static double length_to_expand(const struct taylor *taylor, double now, double t, bool is_long) {
    const double longest = longest_step(taylor->problem, now);
    if (is_long && taylor->is_searched) {
        const double last = taylor->last_length > 0.0 ? taylor->last_length : first_length;
        return last < longest ? last : longest;
    }
    // parts of equal length leave no sliver at the end; nor does rounding
    const double parts = (t - now) / longest * (1.0 - 1e-14);
    return parts > 1.0 ? (t - now) / ceil(parts) : t - now;
}

/* One internal step from the state x at the time now towards the time t. Writes where it ends to
 * *end and the state there, or at t if that is earlier, to x. */
static enum status take_step(struct taylor *taylor, double now, double t, bool is_long, double x[],
                             double *end, struct method_work *work) {
    const double length = length_to_expand(taylor, now, t, is_long);
    double step;
    enum status status = expand(taylor, now, length, is_long, x, &step, work);
    if (status == STATUS_OK) {
        step = step_within_reach(taylor, x, step);
        status = fit_step(taylor, is_long, &step, work);
    }
    if (status != STATUS_OK) {
        return status;
    }
    taylor->expected_order = is_long ? taylor->expected_order : taylor->order;
    const bool lands = step == 1.0 && taylor->time_scale == t - now;
    *end = lands ? t : now + step * taylor->time_scale;
    if (!(*end > now)) {
        return STATUS_NO_CONVERGENCE;
    }
    if (*end > t) {
        evaluate(taylor, (t - now) / taylor->time_scale, x, NULL);
    } else {
        memcpy(x, taylor->end_x, taylor->problem->ode.state_count * sizeof(double));
    }
    taylor->last_length = *end - now;
    work->steps++;
    work->last_order = taylor->order;
    work->last_step = *end - now;
    work->internal = *end;
    return STATUS_OK;
}

/* Writes the coefficients of a row over time with this time scale. */
static void copy_row(const struct taylor *taylor, const double from[], double length, double to[]) {
    double power = 1.0;
    for (int k = 0; k <= taylor->order; k++) {
        to[k] = from[k] * power;
        power *= length;
    }
}

/* Searches the step that has ended at the time end for an event. */
static enum status search(struct taylor *taylor, double end) {
    struct location *location = &taylor->problem->location;
    struct step_polynomial *step = &location->step;
    const size_t *row_of_indicator = taylor->problem->ode.row_of_indicator;
    const double length = (end - taylor->begin) / taylor->time_scale;
    step->begin = taylor->begin;
    step->end = end;
    step->is_from_end = false;
    step->degree = taylor->order;
    step->row = length == 1.0 ? taylor->row : location->rows;
    for (size_t i = 0; length != 1.0 && i < taylor->problem->ode.state_count; i++) {
        copy_row(taylor, taylor->row[i], length, step->row[i]);
    }
    step->has_indicators = row_of_indicator != NULL;
    for (size_t k = 0; step->has_indicators && k < location->used_count; k++) {
        const size_t i = location->used[k];
        if (location->indicators[i].kind == INDICATOR_OF_MODEL) {
            copy_row(taylor, taylor->row[row_of_indicator[i]], length, step->indicator_row[i]);
        }
    }
    return location_search(location);
}

/* Where an advance begins, with the state there: with events, at the end of the last step. */
static double begin_advance(struct taylor *taylor, const double begin_x[], double x[]) {
    const struct problem *problem = taylor->problem;
    const bool has_passed = taylor->is_searched && taylor->passed > problem->reached;
    memcpy(x, has_passed ? taylor->end_x : begin_x, problem->ode.state_count * sizeof(double));
    const double begin = has_passed ? taylor->passed : problem->reached;
    taylor->passed = -INFINITY;
    taylor->longest_scale = INFINITY;
    return begin;
}

static enum status advance(void *memory, double t, int64_t max_steps, const double begin_x[],
                           double *stopped_at, double x[], struct method_work *work) {
    struct taylor *taylor = memory;
    const struct problem *problem = taylor->problem;
    const bool is_searched = taylor->is_searched;
    bool is_long = problem->reached == 0.0 ? problem->continues : is_searched;
    *stopped_at = begin_advance(taylor, begin_x, x);
    work->internal = *stopped_at;
    while (*stopped_at < t) {
        if (work->steps == max_steps) {
            message_write(&problem->sink, STATUS_TOO_MANY_STEPS,
                          "%s: %lld internal steps end at %g s of %g s", integrator_taylor.name,
                          (long long)max_steps, *stopped_at, t);
            return STATUS_TOO_MANY_STEPS;
        }
        double end;
        enum status status = take_step(taylor, *stopped_at, t, is_long, x, &end, work);
        if (status == STATUS_OK && is_searched) {
            status = search(taylor, end);
        }
        if (status != STATUS_OK) {
            return status;
        }
        if (is_searched && problem->location.time <= t) {
            taylor->passed = end;
            *stopped_at = problem->location.time;
            evaluate(taylor, (*stopped_at - taylor->begin) / taylor->time_scale, x, NULL);
            work->is_cut_short = true;
            break;
        }
        if (end > t) {
            taylor->passed = end;
            end = t;
        }
        *stopped_at = end;
        is_long = is_long && is_searched;
        if (end < t && problem->observer != NULL && problem_ends_at(problem, end, x)) {
            work->is_cut_short = true;
            break;
        }
    }
    return STATUS_OK;
}

static bool interpolate(void *memory, double t, double x[]) {
    const struct taylor *taylor = memory;
    if (t > taylor->passed) {
        return false;
    }
    evaluate(taylor, (t - taylor->begin) / taylor->time_scale, x, NULL);
    return true;
}

/* The length of a step follows from the series. With events, it is expanded for what was left of
 * the last one. */
static double next_step(void *memory, const double x[]) {
    const struct taylor *taylor = memory;
    const struct problem *problem = taylor->problem;
    return location_is_active(&problem->location) ? problem->reached - taylor->begin : 0.0;
}

#define TOLERANCE_FRACTION 1e-1

/* Events must not depend on the requested times, so that a long step begins where the last one
 * ended. As in method_cvode.c. */
#define LONGEST_HISTORY_WITH_EVENTS 1000

const struct method integrator_taylor = {
    .name = "taylor",
    .tolerance_fraction = TOLERANCE_FRACTION,
    .longest_history = 1,
    .longest_history_with_events = LONGEST_HISTORY_WITH_EVENTS,
    .needs_series = true,
    .memory_size = memory_size,
    .create = create,
    .destroy = destroy,
    .configure = configure,
    .restart = restart,
    .advance = advance,
    .interpolate = interpolate,
    .next_step = next_step,
};
