#include "taylor_series.h"

#include "workspace.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* Smallest order: the last coefficient of an input enters the states' coefficients two orders
 * before. */
enum { LEAST_ORDER = SERIES_INPUT_LENGTH + 1 };

/* Part of the length that the last terms allow (Jorba and Zou, section 3.2.1). */
static const double safety = 0.9;

/* ---- Life ----------------------------------------------------------------------------------- */

size_t taylor_series_memory_size(const struct ode *ode) {
    const size_t padding = 3 * _Alignof(max_align_t);
    return padding + 4 * ode->state_count * sizeof(double) +
           2 * ode->series_row_count * sizeof(double[SERIES_LENGTH]);
}

bool taylor_series_create(struct problem *problem, struct taylor_series *series) {
    *series = (struct taylor_series){.problem = problem};
    const struct series *rows = problem->ode.rows;
    series->may_hide = rows != NULL && (rows->inner_count > 0 || rows->may_vanish);
    series->weight = workspace_calloc(4 * problem->ode.state_count, sizeof *series->weight);
    series->row = workspace_calloc(problem->ode.series_row_count, sizeof *series->row);
    if (taylor_series_has_few_rows(&problem->ode)) {
        return series->weight != NULL && series->row != NULL;
    }
    series->end_row = workspace_calloc(problem->ode.series_row_count, sizeof *series->end_row);
    return series->weight != NULL && series->row != NULL && series->end_row != NULL;
}

void taylor_series_destroy(struct taylor_series *series) {
    workspace_free(series->end_row);
    workspace_free(series->row);
    workspace_free(series->weight);
}

/* Steps cost least near the order 1 - ln(tolerance) / 2 if all orders cost the same (Jorba and Zou,
 * section 3.2). The first orders, with their sine and cosine, cost as much as several others. */
void taylor_series_configure(struct taylor_series *series) {
    const double e = 2.718281828459045;
    int order = 8; // at a tolerance of 1
    double left = series->problem->settings.relative_tolerance;
    while (left < 1.0 && order < SERIES_LENGTH - 1) {
        order++;
        left *= e * e;
    }
    series->largest_order = order + 1 - order % 2;
    series->expected_order = LEAST_ORDER;
    series->guessed_order = LEAST_ORDER;
}

/* ---- Orders --------------------------------------------------------------------------------- */

/* Writes coefficients as in ode.h; a series begun at order 0, or 1 if that is known, counts as
 * an evaluation. Fails like problem_rhs; the caller checks whether coefficients are finite. */
static enum status extend(struct problem *problem, double t, double time_scale, int first, int last,
                          double rows[][SERIES_LENGTH]) {
    const struct ode *ode = &problem->ode;
    problem->evaluation_count += first <= 1 ? 1 : 0;
    if (ode->series(t, time_scale, first, last, rows, ode->context) == STATUS_OK) {
        return STATUS_OK;
    }
    for (size_t i = 0; i < ode->state_count; i++) {
        problem->failed_x[i] = rows[i][0];
    }
    return problem_fail(problem, t, problem->failed_x);
}

/* Begins the series, with the orders from 0 to last. Order 0 may be known from the step before. */
static enum status begin(struct taylor_series *series, double t, double time_scale,
                         const double x[], int last) {
    const struct integrator_settings *settings = &series->problem->settings;
    const int first = t == series->end ? 1 : 0;
    double(*const known)[SERIES_LENGTH] = series->end_row;
    if (first == 1) {
        series->end_row = series->row;
        series->row = known;
    }
    for (size_t i = 0; i < series->problem->ode.state_count; i++) {
        series->row[i][0] = x[i];
        series->weight[i] =
            1.0 / (settings->relative_tolerance * fabs(x[i]) + settings->absolute_tolerances[i]);
    }
    series->begin = t;
    series->time_scale = time_scale;
    series->order = last;
    series->end = NAN;
    return extend(series->problem, t, time_scale, first, last, series->row);
}

enum status taylor_series_add_orders(struct taylor_series *series, int last) {
    const int first = series->order + 1;
    series->order = last;
    return extend(series->problem, series->begin, series->time_scale, first, last, series->row);
}

/* Returns the sum of the terms of order k, one time scale ahead, in tolerances of the states; or a
 * part of it above the bound. */
static double size_of(const struct taylor_series *series, int k, double bound) {
    double size = 0.0;
    for (size_t i = 0; i < series->problem->ode.state_count && !(size > bound); i++) {
        size += fabs(series->row[i][k]) * series->weight[i];
    }
    return size;
}

/* Returns a number near log2 x, for x >= 0. */
static int exponent_of(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (int)(bits >> 52) - 1023;
}

/* Returns the step at whose end the terms of the orders last - 1 and last, which have these sizes
 * one time scale ahead, are within the tolerance; bound at most, NaN if a size is not finite. */
static double step_of_last_terms(const struct taylor_series *series, int last, double bound) {
    const double size[] = {size_of(series, last - 1, INFINITY), size_of(series, last, INFINITY)};
    if (!isfinite(size[0] + size[1])) {
        return NAN;
    }
    // the order with the larger log2 of the size over the order
    const bool is_last = exponent_of(size[1]) * (last - 1) > exponent_of(size[0]) * last;
    const int limiting = is_last ? last : last - 1;
    const double step = safety * pow(size[is_last ? 1 : 0], -1.0 / limiting);
    return step < bound ? step : bound;
}

/* Adds orders until the series has converged, or has its largest order. Orders stay odd: with steps
 * of even order the errors of a swing cancel, and cease to cancel at a smaller tolerance if some
 * steps have one order more. */
static enum status find_order(struct taylor_series *series) {
    for (int order = LEAST_ORDER;; order += 2) {
        if (order > series->order) {
            const enum status status = taylor_series_add_orders(series, order);
            if (status != STATUS_OK) {
                return status;
            }
        }
        // the terms are within the tolerance and become smaller
        const double size = size_of(series, order - 1, 1.0);
        const bool is_enough = size <= 1.0 && size_of(series, order, size) <= size;
        if (is_enough || order == series->largest_order) {
            series->order = order;
            series->step = is_enough ? 1.0 : step_of_last_terms(series, order, 1.0);
            return STATUS_OK;
        }
    }
}

/* ---- Next event ----------------------------------------------------------------------------- */

NOINLINE double taylor_series_guess_event(const struct problem *problem,
                                          double row[][SERIES_LENGTH], double nearest) {
    const struct location *location = &problem->location;
    const struct series *rows = problem->ode.rows;
    double soonest = INFINITY;
    for (size_t k = 0; k < location->used_count; k++) {
        const size_t i = location->used[k];
        const struct indicator *indicator = &location->indicators[i];
        const bool is_of_state = indicator->kind == INDICATOR_OF_STATE;
        if (!is_of_state && (rows == NULL || rows->row_of_indicator == NULL)) {
            continue;
        }
        const double factor = is_of_state ? indicator->factor : 1.0;
        const double *c = row[is_of_state ? indicator->state : rows->row_of_indicator[i]];
        if (location->is_armed[i] || factor * c[1] > 0.0) {
            const double s = roots_guess(is_of_state ? indicator->offset : 0.0, factor, c);
            soonest = s > nearest && s < soonest ? s : soonest;
        }
    }
    return soonest;
}

/* Nearest and farthest guess, in time scales: what is nearer may be rounding. */
static const double nearest_guess = 0x1p-10;
static const double farthest_guess = 32.0;

/* Smallest order of such a step: that of the guess, and one to judge it. */
enum { LEAST_GUESSED_ORDER = 3 };

/* Makes the step end soon after the next event, if there is a guess of it, with the fewest orders
 * that suffice there. */
static enum status lead_past_guess(struct taylor_series *series, double longest) {
    const double guess = taylor_series_guess_event(series->problem, series->row, nearest_guess);
    if (!(guess < farthest_guess)) {
        return STATUS_OK;
    }
    const double step = fmin(taylor_series_guess_passed * guess, longest);
    double power = step * step;
    double before = power * size_of(series, 2, INFINITY);
    for (int order = LEAST_GUESSED_ORDER; order <= series->largest_order / 2; order++) {
        if (order > series->order) {
            const enum status status = taylor_series_add_orders(series, order);
            if (status != STATUS_OK) {
                return status;
            }
        }
        power *= step;
        const double size = power * size_of(series, order, INFINITY);
        if (before + size <= 1.0) {
            series->order = order;
            series->guessed_order = order;
            series->is_guessed = true;
            series->step = step;
            return STATUS_OK;
        }
        before = size;
    }
    return STATUS_OK;
}

enum status taylor_series_expand(struct taylor_series *series, double t, double time_scale,
                                 const double x[], double longest) {
    const bool is_long = longest > 0.0;
    const bool may_guess = is_long && series->may_guess;
    const int least = series->is_event_near ? LEAST_ORDER + 2 : series->largest_order;
    const int of_long = may_guess ? series->guessed_order : least;
    series->is_guessed = false;
    enum status status =
        begin(series, t, time_scale, x, is_long ? of_long : series->expected_order);
    if (status == STATUS_OK && may_guess) {
        status = lead_past_guess(series, longest);
    }
    if (status != STATUS_OK || series->is_guessed) {
        return status;
    }
    if (!is_long) {
        return find_order(series);
    }
    // the next event may be as near as the last one: most of a longer step would be lost to it
    for (int last = least;; last += 2) {
        if (last > series->order) {
            status = taylor_series_add_orders(series, last);
            if (status != STATUS_OK) {
                return status;
            }
        }
        if (last >= series->largest_order / 2 ||
            size_of(series, last - 1, 1.0) + size_of(series, last, 1.0) <= 1.0) {
            series->order = last;
            series->step = step_of_last_terms(series, last, longest);
            return STATUS_OK;
        }
    }
}

/* ---- Check ---------------------------------------------------------------------------------- */

/* Part of its first terms that the last terms of a series which has converged may have. */
static const double converged = 0x1p-10;

/* Returns by how much a derivative differs from the polynomial's, beyond rounding. */
static inline double missed(double derivative, double of_polynomial) {
    const double rounding = 64.0 * DBL_EPSILON * fabs(of_polynomial);
    const double difference = fabs(derivative - of_polynomial) - rounding;
    return difference <= 0.0 ? 0.0 : difference;
}

/* By how much the series of a solution may miss it: a part of its way, and, over its size, the
 * tolerance or what ill-conditioned equations leave to rounding. */
static const double most_missed = 1e-2;
static const double ill_conditioned = 1e-8;

/* True if the solutions of equations at s are those to which the series lead, not others. */
static bool is_continued(const struct taylor_series *series, double s) {
    const struct series *rows = series->problem->ode.rows;
    for (size_t k = 0; rows != NULL && k < rows->solution_count; k++) {
        const double *row = series->row[rows->solutions[k]];
        double expected = 0.0;
        double way = 0.0; // with all terms of one sign
        for (int order = series->order; order >= 1; order--) {
            expected = (expected + row[order]) * s;
            way = (way + fabs(row[order])) * s;
        }
        const double found = series->end_row[rows->solutions[k]][0] - row[0];
        const double size = fmax(fabs(row[0]), rows->solution_sizes[k]);
        const double tolerance =
            fmax(series->problem->settings.relative_tolerance, ill_conditioned) * size;
        const bool is_read = isfinite(row[0]) != 0; // else the motion would not be finite, either
        if (is_read && !(fabs(found - expected) <= most_missed * way + tolerance)) {
            return false;
        }
    }
    return true;
}

enum status taylor_series_measure_defect(struct taylor_series *series, double s, double end_x[],
                                         double end_dx[], double *defect) {
    const size_t n = series->problem->ode.state_count;
    double(*const end_row)[SERIES_LENGTH] = series->end_row;
    const double end = series->begin + s * series->time_scale;
    series->end = NAN;
    taylor_series_evaluate(series, s, end_x, end_dx);
    for (size_t i = 0; i < n; i++) {
        end_row[i][0] = end_x[i];
    }
    const enum status status = extend(series->problem, end, series->time_scale, 0, 1, end_row);
    if (status != STATUS_OK) {
        return status;
    }
    series->end = location_is_active(&series->problem->location) ? NAN : end;
    *defect = is_continued(series, s) ? 0.0 : INFINITY;
    for (size_t i = 0; i < n; i++) {
        *defect += s * missed(end_row[i][1], end_dx[i]) * series->weight[i];
    }
    return STATUS_OK;
}

/* True if a quantity moves over the step to s by more than its tolerance means, as in stiff
 * equations whose motion has died away, or in proportion to the time. first: its coefficient 0. */
static bool moves(const struct taylor_series *series, const double *first, double s) {
    const size_t stride = series->problem->ode.rows->inner_stride;
    double bent = 0.0; // the way of all orders but the first
    for (int k = series->order; k >= 2; k--) {
        bent = (bent + fabs(first[stride * (size_t)k])) * s;
    }
    const double way = (bent + fabs(first[stride])) * s;
    const double rest = bent == 0.0 ? 0.0 : series->problem->settings.relative_tolerance;
    return !(way <= 16.0 * rest * fabs(*first));
}

bool taylor_series_hides_nothing(const struct taylor_series *series, double s) {
    const struct series *rows = series->problem->ode.rows;
    const size_t stride = rows->inner_stride;
    const double power = s == 1.0 ? 1.0 : pow(s, series->order - 2);
    for (size_t i = 0; i < rows->inner_count; i++) {
        const double *first = &series->row[0][0] + rows->inner[i].place;
        const double *last = first + stride * (size_t)series->order;
        const double begin =
            fabs(first[stride]) + fabs(first[2 * stride]) * s + fabs(first[3 * stride]) * s * s;
        const double end = (fabs(last[0]) * s + fabs(*(last - stride))) * power;
        if (!(end < converged * begin) &&
            moves(series, &series->row[0][0] + rows->inner[i].argument, s)) {
            return false;
        }
    }
    return true;
}

bool taylor_series_vanishes(const struct taylor_series *series) {
    const struct ode *ode = &series->problem->ode;
    if (!ode->rows->may_vanish) {
        return false;
    }
    bool vanishes = false;
    bool rests = !ode->rows->is_of_time;
    for (size_t i = 0; i < ode->state_count; i++) {
        const double *row = series->row[i];
        vanishes |= row[series->order - 1] == 0.0 && row[series->order] == 0.0;
        for (int k = 1; rests && k <= series->order; k++) {
            rests = row[k] == 0.0;
        }
    }
    return vanishes && !rests;
}

/* Returns the defect at s, as of a step to `whole`. x, dx, f: room for states. */
NONNULL static double defect_within(struct taylor_series *series, double s, double whole,
                                    double x[], double dx[], double f[]) {
    const double t = series->begin + s * series->time_scale;
    taylor_series_evaluate(series, s, x, dx);
    double defect = problem_rhs(series->problem, t, x, f) == STATUS_OK ? 0.0 : INFINITY;
    for (size_t i = 0; i < series->problem->ode.state_count; i++) {
        defect += whole * missed(series->time_scale * f[i], dx[i]) * series->weight[i];
    }
    return defect;
}

double taylor_series_part_that_fits(struct taylor_series *series, double s, int points) {
    const size_t n = series->problem->ode.state_count;
    double *room = series->weight + n;
    const double distance = s / (points + 1);
    for (int k = 1; k <= points; k++) {
        const double defect = defect_within(series, k * distance, s, room, room + n, room + 2 * n);
        if (!(defect <= series->order + 1)) {
            return k == 1 ? 0.5 * distance : (k - 1) * distance;
        }
    }
    return s;
}
