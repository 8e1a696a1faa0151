/* Steps by the Taylor series of the solution (taylor_series.h).
 *
 * The time scale of a series is the way to the requested time. Orders are added until the terms one
 * time scale ahead are within the tolerance; the step lands there, and the state is the sum of the
 * coefficients. If the largest order is not enough, a step is as long as this order allows. At its
 * end the polynomial must fit the equations.
 *
 * If a restart continues the same solution, its first step has the largest order and is as long as
 * this allows. The requested times in it are values of one polynomial. After an event another one
 * may be near: then the first step leads past a guess of it, or has about half the order at most.
 */
#include "method.h"
#include "taylor_series.h"
#include "workspace.h"

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

/* Largest length of a step that goes past requested times, in time scales: the terms of a much
 * longer step may have underflowed. */
static const double most_scales = 1000.0;

/* Ratio of the next time scale to the last one, if a term overflows, and in the step after that. */
static const double shrinking = 0x1p-20;
static const double growing = 16.0;

/* Largest length of the first step after an event, in time scales, if all indicators are states:
 * others may be singular at an event. Terms so few do not matter even if they underflow. */
static const double most_after_event = 0x1p40;

struct taylor {
    struct taylor_series series;
    bool is_searched;     /* true if events are searched since the restart */
    double longest_scale; /* largest time scale of the next step of the running advance, s */
    double longest;       /* of the next step, s: less than a step in which a solution was lost */
    double last_length; /* length of the last step, or the one given by a restart, s; 0 if there is
                           none */
    double *end_x;      /* the state at the end of the last step */
    double *end_dx;     /* the derivative of the polynomial there, by its argument */
    double passed; /* end of the step that goes past requested times, s since the restart; -INFINITY
                      if there is none */
};

/* ---- Life ----------------------------------------------------------------------------------- */

static size_t memory_size(const struct ode *ode) {
    const size_t padding = 2 * _Alignof(max_align_t);
    return sizeof(struct taylor) + padding + taylor_series_memory_size(ode) +
           2 * ode->state_count * sizeof(double);
}

static void destroy(void *memory) {
    struct taylor *taylor = memory;
    workspace_free(taylor->end_x);
    taylor_series_destroy(&taylor->series);
    workspace_free(taylor);
}

static enum status create(struct problem *problem, void **memory) {
    *memory = NULL;
    struct taylor *taylor = workspace_calloc(1, sizeof *taylor);
    if (taylor == NULL) {
        return STATUS_OUT_OF_MEMORY;
    }
    const size_t n = problem->ode.state_count;
    taylor->end_x = workspace_calloc(2 * n, sizeof *taylor->end_x);
    const bool has_series = taylor_series_create(problem, &taylor->series);
    if (!has_series || taylor->end_x == NULL) {
        destroy(taylor);
        return STATUS_OUT_OF_MEMORY;
    }
    taylor->end_dx = taylor->end_x + n;
    *memory = taylor;
    return STATUS_OK;
}

static enum status configure(void *memory) {
    taylor_series_configure(&((struct taylor *)memory)->series);
    return STATUS_OK;
}

static enum status restart(void *memory, const double x[]) {
    struct taylor *taylor = memory;
    taylor->passed = -INFINITY;
    taylor->is_searched = location_is_active(&taylor->series.problem->location);
    taylor->last_length = taylor->series.problem->first_step;
    taylor->series.is_event_near = taylor->is_searched && taylor->series.problem->is_after_event;
    taylor->series.may_guess = taylor->series.is_event_near;
    return STATUS_OK;
}

/* ---- Check ---------------------------------------------------------------------------------- */

/* Points at which a step is looked into, and fewer where a product of polynomials may be hidden. */
static const int most_points = 31;
static const int few_points = 7;

/* Returns the part of a step, in time scales, that hides nothing: up to the first point within that
 * does not fit, or a step for which the distance of the points is known. */
static double part_that_hides_nothing(struct taylor *taylor, double step) {
    struct taylor_series *series = &taylor->series;
    if (!series->may_hide) {
        return step;
    }
    const bool is_inner = !taylor_series_hides_nothing(series, step);
    if (!is_inner && !taylor_series_vanishes(series)) {
        return step;
    }
    // with events a scale is the step before: it may grow
    const double scales = taylor->is_searched ? 2.0 : 1.0;
    const double longest = is_inner ? scales : most_points + 1.0;
    if (step > longest) {
        return fmax(0.5 * step, longest);
    }
    const int points = is_inner || step > 1.0 ? most_points : few_points;
    return taylor_series_part_that_fits(series, step, points);
}

/* Makes the polynomial fit the equations in the step and at its end, *step time scales long: adds
 * orders, or cuts *step, which counts as a failed step. is_long: orders are not added. Writes end_x
 * and end_dx. */
static enum status fit_step(struct taylor *taylor, bool is_long, double *step,
                            struct method_work *work) {
    struct taylor_series *series = &taylor->series;
    for (;;) {
        double defect;
        enum status status =
            taylor_series_measure_defect(series, *step, taylor->end_x, taylor->end_dx, &defect);
        if (status != STATUS_OK) {
            return status;
        }
        // within the bound, the first term left out is about a tolerance at most
        const bool fits_at_end = defect <= series->order + 1;
        const double part = fits_at_end ? part_that_hides_nothing(taylor, *step) : 0.5 * *step;
        if (part == *step) {
            return STATUS_OK;
        }
        if (!fits_at_end && *step == 1.0 && !is_long && series->order < series->largest_order) {
            status = taylor_series_add_orders(series, series->order + 2);
            if (status != STATUS_OK) {
                return status;
            }
        } else if (series->begin + part * series->time_scale > series->begin &&
                   (isfinite(defect) ||
                    !problem_has_ended(series->problem, series->begin,
                                       series->begin + *step * series->time_scale))) {
            *step = part;
            work->failed_steps++;
        } else {
            const double end = series->begin + *step * series->time_scale;
            return isfinite(defect) ? STATUS_NO_CONVERGENCE
                                    : problem_fail(series->problem, end, taylor->end_x);
        }
    }
}

/* ---- Steps ---------------------------------------------------------------------------------- */

/* Returns the longest step from the time t on, s. */
static double longest_step(const struct taylor *taylor, double t) {
    const struct problem *problem = taylor->series.problem;
    const double max_step = problem->settings.max_step;
    const double left = fmin(problem->horizon - t, taylor->longest);
    return max_step > 0.0 && max_step < left ? max_step : left;
}

static double longest_step_in_scales(const struct taylor *taylor, double t, double time_scale) {
    const double longest = longest_step(taylor, t) / time_scale;
    const bool is_free =
        taylor->series.is_event_near && !taylor->series.problem->location.needs_model;
    const double grown = is_free ? most_after_event : growing;
    const double most = taylor->is_searched ? grown : most_scales;
    return longest < most ? longest : most;
}

/* Expands the solution about the state x at the time t (s since the restart). The time scale is
 * `length` (s), or shorter if terms overflow. is_long: for a step as long as its orders
 * allow; otherwise for a step of one time scale at most. */
static enum status expand(struct taylor *taylor, double t, double length, bool is_long,
                          const double x[], struct method_work *work) {
    double time_scale = taylor->longest_scale < length ? taylor->longest_scale : length;
    while (time_scale >= DBL_MIN) {
        const double longest = is_long ? longest_step_in_scales(taylor, t, time_scale) : 0.0;
        const enum status status = taylor_series_expand(&taylor->series, t, time_scale, x, longest);
        if (status != STATUS_OK || !isnan(taylor->series.step)) {
            // the next step need not begin from the whole length again
            taylor->longest_scale = time_scale < length ? growing * time_scale : INFINITY;
            return status;
        }
        (void)problem_fail(taylor->series.problem, t, x);
        work->failed_steps++;
        time_scale *= shrinking;
    }
    return STATUS_NOT_FINITE;
}

/* Shortest step to which the reach of a state cuts a step, relative to the time since the restart.
 */
static const double resolution = 0x1p-40;

/* Returns a step (in time scales) in which no state moves farther from x, its begin, than it may.
 */
static double step_within_reach(struct taylor *taylor, const double x[], double step) {
    const struct taylor_series *series = &taylor->series;
    const struct ode *ode = &series->problem->ode;
    if (!taylor->is_searched || ode->reach == NULL) {
        return step;
    }
    struct location *location = &series->problem->location;
    double *reach = location->dx;
    ode->reach(x, reach, ode->context);
    double within = step;
    for (size_t i = 0; i < ode->state_count; i++) {
        if (reach[i] == INFINITY) {
            continue;
        }
        double way = 0.0;
        for (int k = series->order; k >= 1; k--) {
            way = (way + fabs(series->row[i][k])) * step;
        }
        if (way > reach[i]) {
            // the way grows at least in proportion to the step
            within = fmin(within, step * (reach[i] / way));
        }
    }
    if (within == step) {
        return step;
    }
    const double shortest = resolution * series->begin / series->time_scale;
    return fmax(within, fmin(step, shortest));
}

/* Length of a step without one before it, s. */
static const double first_length = 1e-3;

/* Returns the length for which a step from `now` towards t is expanded, s. With events, long steps
 * must not depend on t: then it is the length of the step before. */
static double length_to_expand(const struct taylor *taylor, double now, double t, bool is_long) {
    const double longest = longest_step(taylor, now);
    if (is_long && taylor->is_searched) {
        // events may follow each other so closely that the length underflows
        const double last = taylor->last_length >= DBL_MIN ? taylor->last_length : first_length;
        return last < longest ? last : longest;
    }
    // parts of equal length leave no sliver at the end; nor does rounding
    const double parts = (t - now) / longest * (1.0 - 1e-14);
    return parts > 1.0 ? (t - now) / ceil(parts) : t - now;
}

/* Takes one internal step from the state x at the time now towards the time t. Writes its end to
 * *end and the state there, or at t if that is earlier, to x. */
static enum status take_step(struct taylor *taylor, double now, double t, bool is_long, double x[],
                             double *end, struct method_work *work) {
    struct taylor_series *series = &taylor->series;
    const size_t n = series->problem->ode.state_count;
    const double length = length_to_expand(taylor, now, t, is_long);
    enum status status = expand(taylor, now, length, is_long, x, work);
    double step = series->step;
    if (status == STATUS_OK) {
        step = step_within_reach(taylor, x, step);
        status = fit_step(taylor, is_long, &step, work);
    }
    if (status == STATUS_NOT_FINITE && !problem_are_finite(series->problem->failed_x, n)) {
        return problem_fail(series->problem, now, x); // no state that a user can look for
    }
    if (status != STATUS_OK) {
        return status;
    }
    series->expected_order = is_long ? series->expected_order : series->order;
    series->is_event_near = series->is_guessed;
    series->may_guess = false;
    const bool lands = step == 1.0 && series->time_scale == t - now;
    *end = lands ? t : now + step * series->time_scale;
    if (!(*end > now)) {
        return STATUS_NO_CONVERGENCE;
    }
    const bool is_cut = *end < t && *end - now < 0.5 * longest_step(taylor, now);
    if (is_cut && problem_has_ended(series->problem, now, *end)) { // steps creep up to an edge
        return problem_fail(series->problem, *end, taylor->end_x);
    }
    if (*end > t) {
        taylor_series_evaluate(series, (t - now) / series->time_scale, x, NULL);
    } else {
        memcpy(x, taylor->end_x, n * sizeof(double));
    }
    // after a wrong guess the next step is as if there had been none
    taylor->last_length = series->is_guessed ? taylor->last_length : *end - now;
    work->steps++;
    work->last_order = series->order;
    work->last_step = *end - now;
    work->internal = *end;
    return STATUS_OK;
}

/* Writes the coefficients of a row over time with this time scale. */
static void copy_row(const struct taylor *taylor, const double from[], double length, double to[]) {
    double power = 1.0;
    for (int k = 0; k <= taylor->series.order; k++) {
        to[k] = from[k] * power;
        power *= length;
    }
}

/* Searches the step that has ended at the time end for an event. */
static enum status search(struct taylor *taylor, double end) {
    const struct taylor_series *series = &taylor->series;
    struct location *location = &series->problem->location;
    struct step_polynomial *step = &location->step;
    const struct series *rows = series->problem->ode.rows;
    const size_t *row_of_indicator = rows == NULL ? NULL : rows->row_of_indicator;
    const double length = (end - series->begin) / series->time_scale;
    step->begin = series->begin;
    step->end = end;
    step->is_from_end = false;
    step->degree = series->order;
    step->row = length == 1.0 ? series->row : location->rows;
    for (size_t i = 0; length != 1.0 && i < series->problem->ode.state_count; i++) {
        copy_row(taylor, series->row[i], length, step->row[i]);
    }
    bool has_any = false;
    for (size_t k = 0; row_of_indicator != NULL && k < location->used_count; k++) {
        const size_t i = location->used[k];
        location->has_row[i] = location->indicators[i].kind == INDICATOR_OF_MODEL;
        if (location->has_row[i]) {
            has_any = true;
            copy_row(taylor, series->row[row_of_indicator[i]], length, step->indicator_row[i]);
        }
    }
    if (has_any) {
        location_check_rows(location, taylor->end_x, series->problem->settings.relative_tolerance);
    }
    return location_search(location);
}

/* Returns the begin of an advance and writes the state there: with events, it is the end of the
 * last step. */
static double begin_advance(struct taylor *taylor, const double begin_x[], double x[]) {
    const struct problem *problem = taylor->series.problem;
    const bool has_passed = taylor->is_searched && taylor->passed > problem->reached;
    memcpy(x, has_passed ? taylor->end_x : begin_x, problem->ode.state_count * sizeof(double));
    const double begin = has_passed ? taylor->passed : problem->reached;
    taylor->passed = -INFINITY;
    taylor->longest_scale = INFINITY;
    taylor->series.end = NAN;
    return begin;
}

/* Goes back to the begin of a step in which a solution is lost. Returns false if no shorter step
 * can be tried. */
static bool can_be_shorter(struct taylor *taylor, double begin, double end, double x[]) {
    struct problem *problem = taylor->series.problem;
    (void)problem_fail(problem, end, taylor->end_x);
    taylor_series_evaluate(&taylor->series, 0.0, x, NULL);
    taylor->longest = 0.5 * (end - begin);
    return begin + taylor->longest > begin && !problem_has_ended(problem, begin, end);
}

/* Takes steps until t or an event. is_long: of the first step. */
static enum status take_steps(struct taylor *taylor, double t, int64_t max_steps, bool is_long,
                              const double begin_x[], double *stopped_at, double x[],
                              struct method_work *work) {
    struct taylor_series *series = &taylor->series;
    const struct problem *problem = series->problem;
    const bool is_searched = taylor->is_searched;
    *stopped_at = begin_advance(taylor, begin_x, x);
    work->internal = *stopped_at;
    taylor->longest = INFINITY;
    while (*stopped_at < t) {
        if (work->steps == max_steps) {
            message_write(&problem->sink, STATUS_TOO_MANY_STEPS,
                          "%s: %lld internal steps end at t = %.12g, before t = %.12g",
                          integrator_taylor.name, (long long)max_steps,
                          problem->origin + *stopped_at, problem->origin + t);
            return STATUS_TOO_MANY_STEPS;
        }
        double end;
        enum status status = take_step(taylor, *stopped_at, t, is_long, x, &end, work);
        if (status == STATUS_OK && is_searched) {
            status = search(taylor, end);
            if (status == STATUS_NOT_FINITE && can_be_shorter(taylor, *stopped_at, end, x)) {
                work->internal = *stopped_at;
                work->failed_steps++;
                work->steps--;
                continue;
            }
        }
        if (status != STATUS_OK) {
            return status;
        }
        taylor->longest = INFINITY;
        if (is_searched && problem->location.time <= t) {
            taylor->passed = end;
            *stopped_at = problem->location.time;
            taylor_series_evaluate(&taylor->series,
                                   (*stopped_at - taylor->series.begin) / taylor->series.time_scale,
                                   x, NULL);
            work->is_cut_short = true;
            break;
        }
        problem_settle(series->problem, end, taylor->end_x);
        if (end > t) {
            taylor->passed = end;
            end = t;
        }
        *stopped_at = end;
        is_long = is_long && is_searched;
        if (end < t && problem->observer != NULL && problem_ask_observer(problem, end, x)) {
            work->is_cut_short = true;
            break;
        }
    }
    return STATUS_OK;
}

static enum status advance(void *memory, double t, int64_t max_steps, const double begin_x[],
                           double *stopped_at, double x[], struct method_work *work) {
    struct taylor *taylor = memory;
    struct taylor_series *series = &taylor->series;
    const struct problem *problem = series->problem;
    const bool is_long = problem->reached == 0.0 ? problem->continues : taylor->is_searched;
    double few_rows[2][TAYLOR_FEW_ROWS][SERIES_LENGTH];
    double(*const kept)[SERIES_LENGTH] = series->row;
    const bool has_few_rows = taylor_series_has_few_rows(&problem->ode);
    if (has_few_rows) {
        // only a step that goes past requested times, or is searched, is read later
        series->row = is_long || taylor->is_searched ? kept : few_rows[0];
        series->end_row = few_rows[1];
    }
    const enum status status =
        take_steps(taylor, t, max_steps, is_long, begin_x, stopped_at, x, work);
    if (has_few_rows) {
        series->row = kept;
        series->end_row = NULL;
    }
    return status;
}

static bool interpolate(void *memory, double t, double x[]) {
    const struct taylor *taylor = memory;
    if (t > taylor->passed) {
        return false;
    }
    taylor_series_evaluate(&taylor->series, (t - taylor->series.begin) / taylor->series.time_scale,
                           x, NULL);
    return true;
}

/* Returns, if events are searched, the length of the last step's part up to here, for which the
 * next step is expanded; otherwise 0, because the series gives the length. */
static double next_step(void *memory, const double x[]) {
    const struct taylor *taylor = memory;
    const struct problem *problem = taylor->series.problem;
    return location_is_active(&problem->location) ? problem->reached - taylor->series.begin : 0.0;
}

#define TOLERANCE_FRACTION 1e-1

/* Events must not depend on the requested times, so that a long step begins at the end of the last
 * one. As in method_cvode.c. */
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
