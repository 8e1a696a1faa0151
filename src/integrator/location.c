#include "location.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- Life ----------------------------------------------------------------------------------- */

bool location_create(const struct ode *ode, const struct integrator_settings *settings,
                     struct location *location) {
    const size_t states = ode->state_count;
    const size_t count = ode->indicator_count;
    *location = (struct location){.ode = ode, .settings = settings, .time = INFINITY};
    if (count == 0) {
        return true;
    }
    const size_t in_rows = (states + count) * SERIES_LENGTH;
    location->x =
        calloc(3 * states + 6 * count + in_rows + count * CHEBYSHEV_LENGTH, sizeof *location->x);
    location->used = calloc(count, sizeof *location->used);
    location->is_armed = calloc(3 * count, sizeof *location->is_armed);
    location->kept = calloc(count, sizeof *location->kept);
    if (location->x == NULL || location->used == NULL || location->is_armed == NULL ||
        location->kept == NULL) {
        location_destroy(location);
        return false;
    }
    location->dx = location->x + states;
    location->restart_x = location->dx + states;
    location->z = location->restart_x + states;
    location->first = location->z + count;
    location->noise = location->first + count;
    location->touch = location->noise + count;
    location->rounding = location->touch + count;
    location->error = location->rounding + count;
    location->rows = (double(*)[SERIES_LENGTH])(location->error + count);
    location->step.indicator_row = location->rows + states;
    location->samples = (double(*)[CHEBYSHEV_LENGTH])(location->error + count + in_rows);
    location->has_row = location->is_armed + count;
    location->triggered = location->has_row + count;
    return true;
}

void location_destroy(struct location *location) {
    free(location->kept);
    free(location->is_armed);
    free(location->used);
    free(location->x);
    *location = (struct location){.time = INFINITY};
}

/* ---- Restart --------------------------------------------------------------------------------- */

/* Returns the error of a state that no event follows from, in its unit: the tolerance, or the
 * rounding of all steps so far. However small the state is at a restart, it has the error of its
 * usual size: absolute tolerances are relative ones of a hundredth of it. */
static double error_of(const struct location *location, size_t state, double x) {
    const struct integrator_settings *settings = location->settings;
    const double tolerance = settings->absolute_tolerances[state];
    const double usual = 100.0 * tolerance / settings->relative_tolerance;
    return larger(tolerance, 2.0 * falls_roundings * DBL_EPSILON * larger(fabs(x), usual));
}

/* Restarts the indicators of the model, whose noise follows from their limits so far. */
static enum status restart_model(struct location *location, const double x[]) {
    const struct ode *ode = location->ode;
    const struct integrator_settings *settings = location->settings;
    const enum status status = ode->indicators(0.0, x, location->z, ode->context);
    const bool has_errors = ode->rounding != NULL && location_errors_matter(location);
    if (has_errors) {
        for (size_t i = 0; i < ode->state_count; i++) {
            location->x[i] = 2.0 * DBL_EPSILON * fabs(x[i]);
            location->dx[i] = error_of(location, i, x[i]) / falls_roundings;
        }
        ode->rounding(location->dx, location->touch, ode->context);
        ode->rounding(location->x, location->first, ode->context);
        for (size_t i = 0; i < ode->state_count; i++) {
            location->x[i] =
                settings->absolute_tolerances[i] + settings->relative_tolerance * fabs(x[i]);
        }
        ode->rounding(location->x, location->error, ode->context);
    }
    for (size_t k = 0; status == STATUS_OK && k < location->used_count; k++) {
        const size_t i = location->used[k];
        location->touch[i] *= has_errors ? falls_roundings : 1.0;
        if (location->indicators[i].kind != INDICATOR_OF_MODEL) {
            continue;
        }
        location->is_armed[i] = location->z[i] > 0.0;
        location->samples[i][0] = location->z[i];
        location->calm_end = 0.0;
        if (!has_errors) {
            location->rounding[i] = 0.0;
            location->error[i] = 0.0;
        } else {
            location->rounding[i] = larger(location->first[i], DBL_MIN);
            location->noise[i] = larger(location->error[i], location->rounding[i]);
            location->is_armed[i] = location->z[i] > location->rounding[i];
        }
    }
    return status;
}

/* Writes which indicators are used. */
static void find_used(struct location *location) {
    location->needs_model = false;
    location->used_count = 0;
    for (size_t i = 0; i < location->ode->indicator_count; i++) {
        const struct indicator *indicator = &location->indicators[i];
        if (indicator->kind == INDICATOR_OF_MODEL ||
            (indicator->kind == INDICATOR_OF_STATE && indicator->factor != 0.0)) {
            location->used[location->used_count] = i;
            location->used_count++;
            location->needs_model |= indicator->kind == INDICATOR_OF_MODEL;
        }
    }
}

enum status location_restart(struct location *location, const struct integrator_start *start,
                             const double x[]) {
    const struct indicator *indicators = start->indicators;
    location->indicators = indicators;
    location->time = INFINITY;
    location->calm = 0.0;
    location->calm_end = NAN;
    if (indicators == NULL) {
        return STATUS_OK;
    }
    if (!start->keeps_indicators) {
        find_used(location);
    }
    memcpy(location->restart_x, x, location->ode->state_count * sizeof *x);
    for (size_t k = 0; k < location->used_count; k++) {
        const size_t i = location->used[k];
        const struct indicator *indicator = &indicators[i];
        const double rounding = 2.0 * DBL_EPSILON * fabs(indicator->offset);
        location->has_row[i] = false;
        if (indicator->kind == INDICATOR_OF_MODEL) {
            location->noise[i] = larger(2.0 * rounding, DBL_MIN);
            location->touch[i] = 2.0 * rounding;
        } else {
            const double factor = fabs(indicator->factor);
            const double z = indicator->offset + indicator->factor * x[indicator->state];
            const bool is_sure = indicator->rises || z > 0.0;
            location->is_armed[i] = is_sure && (z > rounding || (rounding == 0.0 && z >= 0.0));
            const double miss = factor * location->settings->absolute_tolerances[indicator->state];
            location->noise[i] = is_sure ? rounding : larger(rounding, miss);
            location->touch[i] =
                factor * error_of(location, indicator->state, x[indicator->state]) + 4.0 * rounding;
        }
    }
    return location->needs_model ? restart_model(location, x) : STATUS_OK;
}

/* ---- Indicators of states ------------------------------------------------------------------- */

static enum status evaluate(struct location *location, double t, const double x[]) {
    return location->ode->indicators(t, x, location->z, location->ode->context);
}

/* Returns roots_first_fall of indicator i, whose polynomial is p. */
static double first_fall(const struct location *location, size_t i,
                         const struct roots_polynomial *p, double error, double latest,
                         bool is_restart) {
    const bool is_near =
        location->indicators[i].kind == INDICATOR_OF_MODEL && p->c[0] <= location->error[i];
    const double touch = larger(location->touch[i], is_near ? location->error[i] : 0.0);
    return roots_first_fall(p, &(struct fall){.error = error,
                                              .touch = touch,
                                              .latest = latest,
                                              .is_restart = is_restart,
                                              .is_armed = &location->is_armed[i],
                                              .noise = &location->noise[i]});
}

/* Replaces c(s) by c(s - 1). */
static void shift(double c[], int degree) {
    for (int i = 0; i < degree; i++) {
        for (int k = degree - 1; k >= i; k--) {
            c[k] -= c[k + 1];
        }
    }
}

/* Writes an indicator's coefficients but c[0] from its state's; sign: factor of odd orders. */
static void expand(const struct step_polynomial *step, const struct indicator *indicator,
                   double sign, double c[]) {
    const double *row = step->row[indicator->state];
    for (int k = 1; k <= step->degree; k++) {
        c[k] = (k % 2 == 0 ? 1.0 : sign) * indicator->factor * row[k];
    }
}

/* Returns a bound of how far a state moves over a step: the sum of |row[k]|, 0 < k <= degree. */
static double way_of(const double row[], int degree) {
    double way[2] = {0.0, 0.0};
    const double *c = row + 1;
    for (const double *end = row + degree; c < end; c += 2) {
        way[0] += fabs(c[0]);
        way[1] += fabs(c[1]);
    }
    return way[0] + way[1] + (degree % 2 != 0 ? fabs(row[degree]) : 0.0);
}

/* True if the state moves by less than the indicator is above 0 and above its noise at a restart.
 */
static bool is_far_above(const struct location *location, size_t i) {
    const struct step_polynomial *step = &location->step;
    const struct indicator *indicator = &location->indicators[i];
    const double value = indicator->offset + indicator->factor * step->row[indicator->state][0];
    const double noise = location->is_armed[i] ? 0.0 : location->noise[i];
    const double way = way_of(step->row[indicator->state], step->degree);
    const double slack = 0x1p-40; // far above all rounding here and in Horner's scheme
    return (1.0 - slack) * value > (1.0 + slack) * fabs(indicator->factor) * way + noise;
}

static double first_of_state(struct location *location, size_t i, double latest) {
    const struct step_polynomial *step = &location->step;
    const struct indicator *indicator = &location->indicators[i];
    double c[ROOTS_LENGTH];
    c[0] = indicator->offset + indicator->factor * step->row[indicator->state][0];
    if (step->is_from_end) {
        // backwards in time a proof needs no shift
        expand(step, indicator, -1.0, c);
        if (roots_is_above(&(struct roots_polynomial){c, step->degree, -1.0})) {
            location->is_armed[i] = true;
            return INFINITY;
        }
    }
    expand(step, indicator, 1.0, c);
    if (step->is_from_end) {
        shift(c, step->degree);
    }
    const struct roots_polynomial p = {c, step->degree, -1.0};
    return first_fall(location, i, &p, 0.0, latest, step->begin == 0.0);
}

/* ---- States within a step ------------------------------------------------------------------- */

void location_write_states(const struct location *location, double s, double x[]) {
    const struct step_polynomial *step = &location->step;
    const double at = step->is_from_end ? s - 1.0 : s;
    for (size_t i = 0; i < location->ode->state_count; i++) {
        double sum = step->row[i][step->degree];
        for (int k = step->degree - 1; k >= 0; k--) {
            sum = sum * at + step->row[i][k];
        }
        x[i] = sum;
    }
}

/* ---- Indicators of the model ---------------------------------------------------------------- */

/* Largest error of a polynomial that represents an indicator, relative to the values' scale. */
static const double representation = 1e-12;

/* Largest correction of a root at once. */
static const double largest_correction = 0x1p-10;

/* Returns the root s of the polynomial p, corrected to a root of its indicator. error: of p where
 * the correction is not worth an evaluation. */
static double corrected(struct location *location, size_t i, const struct roots_polynomial *p,
                        double error, double s) {
    const struct step_polynomial *step = &location->step;
    for (int tries = 0; tries < 3; tries++) {
        const double t = step->begin + s * (step->end - step->begin);
        location_write_states(location, s, location->x);
        const bool is_known = evaluate(location, t, location->x) == STATUS_OK;
        const double next = s - location->z[i] / horner(p->c, p->degree, s).slope;
        const bool is_small = fabs(next - s) < largest_correction;
        if (!is_known || !is_small || next <= 0.0 || fabs(location->z[i]) <= error) {
            break;
        }
        s = fmin(next, 1.0);
    }
    return s;
}

/* Returns the first fall of an indicator of the model whose polynomial is given: it is as exact as
 * the steps are. */
static double first_of_model(struct location *location, size_t i, double latest) {
    const struct step_polynomial *step = &location->step;
    const struct roots_polynomial p = {step->indicator_row[i], step->degree, -1.0};
    double size = 0.0;
    for (int k = 0; k <= step->degree; k++) {
        size += fabs(p.c[k]);
    }
    const double error = representation * size;
    const double s = first_fall(location, i, &p, error, latest, step->begin == 0.0);
    return s < 1.0 ? corrected(location, i, &p, error, s) : s;
}

/* Writes all indicators at s of the whole step to column k of samples. */
static enum status sample(struct location *location, double s, int k) {
    const struct step_polynomial *step = &location->step;
    location_write_states(location, s, location->x);
    const double t = step->begin + s * (step->end - step->begin);
    const enum status status = evaluate(location, t, location->x);
    for (size_t j = 0; status == STATUS_OK && j < location->used_count; j++) {
        const size_t i = location->used[j];
        location->samples[i][k] = location->z[i];
    }
    return status;
}

/* A part of a step. */
struct piece {
    double begin; /* s */
    double length;
    int count;        /* number of points sampled */
    size_t indicator; /* the last one searched */
    double error;     /* of its polynomial, in its unit */
    int vain_halves;  /* searched halves in which no part has a smaller error */
};

/* Samples between the points of the piece, which then has 2 count - 1 points. */
static enum status sample_between(struct location *location, struct piece *piece) {
    const int count = 2 * piece->count - 1;
    for (size_t j = 0; j < location->used_count; j++) {
        double *samples = location->samples[location->used[j]];
        for (size_t k = (size_t)piece->count - 1; k > 0; k--) {
            samples[2 * k] = samples[k];
        }
    }
    enum status status = STATUS_OK;
    for (int k = 1; status == STATUS_OK && k < count; k += 2) {
        status = sample(location, piece->begin + piece->length * chebyshev_point(count, k), k);
    }
    piece->count = count;
    return status;
}

enum { FEWEST_POINTS = 5 };

static enum status begin_piece(struct location *location, double begin, double length,
                               struct piece *piece) {
    *piece = (struct piece){begin, length, FEWEST_POINTS, 0, 0.0, 0};
    enum status status = STATUS_OK;
    const bool is_at_restart = begin == 0.0 && location->calm_end == 0.0 &&
                               location->step.begin == 0.0 && !location->step.is_from_end;
    location->calm_end = is_at_restart ? 0.0 : NAN;
    for (int k = is_at_restart ? 1 : 0; status == STATUS_OK && k < FEWEST_POINTS; k++) {
        status = sample(location, begin + length * chebyshev_point(FEWEST_POINTS, k), k);
    }
    return status;
}

static const double far_above = 16.0; // errors of a polynomial by which it is surely above 0

/* True if the indicators of the whole step, at these points, stay above 0 because they vary by far
 * less than they are above it. */
static bool are_calm(struct location *location, int count) {
    for (size_t k = 0; k < location->used_count; k++) {
        const size_t i = location->used[k];
        double lowest = INFINITY;
        double highest = -INFINITY;
        bool is_known = true;
        for (int j = 0; j < count; j++) {
            const double z = location->samples[i][j];
            lowest = z < lowest ? z : lowest;
            highest = larger(z, highest);
            is_known &= isfinite(z) != 0;
        }
        const bool is_wanted =
            location->indicators[i].kind == INDICATOR_OF_MODEL && !location->has_row[i];
        const double noise = location->is_armed[i] ? 0.0 : location->noise[i];
        const bool is_above = lowest > larger(noise, 0.5 * far_above * (highest - lowest));
        if (is_wanted && !(is_known && is_above)) {
            return false;
        }
        location->is_armed[i] |= is_wanted;
    }
    for (size_t k = 0; k < location->used_count; k++) {
        const size_t i = location->used[k];
        location->samples[i][0] = location->samples[i][count - 1]; // the next step begins there
    }
    location->calm = location->step.end - location->step.begin;
    location->calm_end = location->step.end;
    return true;
}

/* True if indicators that were calm in the last step are so in this one, which is not much longer:
 * its begin, its end and two points between are enough to see them begin to move. The points are
 * not symmetric, so that no swing is the same at all of them. */
static bool stay_calm(struct location *location) {
    static const double points[] = {0.0, 0.375, 0.8125, 1.0};
    const struct step_polynomial *step = &location->step;
    bool is_calm =
        step->end - step->begin <= 2.0 * location->calm && step->begin == location->calm_end;
    location->calm = 0.0;
    for (int k = 1; is_calm && k < 4; k++) {
        is_calm = sample(location, points[k], k) == STATUS_OK;
    }
    return is_calm && are_calm(location, 4);
}

/* Searches one indicator in a piece. Returns false if the piece needs more points. */
static bool search_piece(struct location *location, struct piece *piece, size_t i,
                         bool is_last_try) {
    double c[ROOTS_LENGTH] = {0};
    const double error = chebyshev_interpolate(piece->count, location->samples[i], c);
    piece->indicator = i;
    piece->error = error;
    double size = 0.0;
    for (int k = 0; k < piece->count; k++) {
        size = larger(fabs(location->samples[i][k]), size);
    }
    const double noise = larger(representation * size, location->rounding[i]);
    const bool is_exact = error <= noise;
    const int degree = piece->count - 1;
    if (!is_exact && !is_last_try) {
        c[0] -= larger(far_above * error, location->is_armed[i] ? 0.0 : location->noise[i]);
        const bool is_above = roots_is_above(&(struct roots_polynomial){c, degree, -1.0});
        location->is_armed[i] |= is_above;
        return is_above;
    }
    const struct roots_polynomial p = {c, degree, -1.0};
    const bool is_restart = location->step.begin == 0.0 && piece->begin == 0.0;
    const double s = first_fall(location, i, &p, noise, INFINITY, is_restart);
    location->first[i] = fmin(location->first[i], piece->begin + piece->length * s);
    return true;
}

/* Shortest piece of a step: a step is divided in two until polynomials represent all indicators. */
static const double shortest_piece = 0x1p-10;

/* Part of a piece's error that its halves have where an indicator is but rounding. */
static const double no_gain = 0x1p-6;

/* Searches the indicators from number `from` on in a half of a piece, or in a step. */
static enum status search_model_in(struct location *location, double begin, double length,
                                   size_t from, struct piece *whole) {
    struct piece piece;
    enum status status = begin_piece(location, begin, length, &piece);
    if (status != STATUS_OK || are_calm(location, piece.count)) {
        location->calm = length == 1.0 ? location->calm : 0.0;
        return status;
    }
    size_t i = from;
    while (status == STATUS_OK && i < location->ode->indicator_count) {
        const bool is_wanted = location->indicators[i].kind == INDICATOR_OF_MODEL &&
                               !location->has_row[i] && location->first[i] > begin;
        if (!is_wanted || search_piece(location, &piece, i, false)) {
            i++;
        } else if (piece.count < CHEBYSHEV_LENGTH) {
            status = sample_between(location, &piece);
        } else {
            const bool gains = i != whole->indicator || piece.error < no_gain * whole->error;
            if (length > shortest_piece && (gains || whole->vain_halves == 0)) {
                const double half = 0.5 * length;
                for (int k = 0; k < 2 && status == STATUS_OK; k++) {
                    status = search_model_in(location, begin + k * half, half, i, &piece);
                }
                whole->vain_halves += !gains && piece.vain_halves == 2;
                break;
            }
            whole->vain_halves += !gains;
            (void)search_piece(location, &piece, i, true);
            i++;
        }
    }
    return status;
}

/* ---- Steps ---------------------------------------------------------------------------------- */

/* True if the polynomial will do for an indicator that is z at the end of the step: its error, by
 * its last terms and what the sum misses, is small, or the first fall is known in spite of it. If
 * the polynomial stays above 0 by far more, c[0] is lowered, so that later proofs hold. */
static bool make_represent(double c[], int degree, double z, double relative_tolerance) {
    double sum = 0.0;
    double size = 0.0;
    for (int k = degree; k >= 0; k--) {
        sum += c[k];
        size += fabs(c[k]);
    }
    const double last = degree > 0 ? fabs(c[degree - 1]) + fabs(c[degree]) : 0.0;
    const double error = last + fabs(sum - z);
    if (!isfinite(size) || error <= relative_tolerance * size) {
        return isfinite(size);
    }
    const double begin = c[0];
    c[0] -= far_above * error;
    const double first = roots_first(&(struct roots_polynomial){c, degree, -1.0});
    if (first == INFINITY) {
        return true;
    }
    // surely above 0 up to here, and surely below soon after
    const double soon = first + 0.5 * largest_correction;
    c[0] = begin;
    return first > 0.0 && soon < 1.0 && horner(c, degree, soon).value < -far_above * error;
}

void location_check_rows(struct location *location, const double x[], double relative_tolerance) {
    const struct step_polynomial *step = &location->step;
    if (evaluate(location, step->end, x) != STATUS_OK) {
        return;
    }
    for (size_t k = 0; k < location->used_count; k++) {
        const size_t i = location->used[k];
        location->has_row[i] =
            location->has_row[i] && make_represent(step->indicator_row[i], step->degree,
                                                   location->z[i], relative_tolerance);
    }
}

/* Part of a step within which roots of several indicators are one event. */
static const double same_time = 4.0 * 0x1p-52;

/* Returns about where an indicator falls, s: by the parabola with the first terms. */
static double guessed_fall(const struct location *location, size_t i) {
    const struct step_polynomial *step = &location->step;
    const struct indicator *indicator = &location->indicators[i];
    if (indicator->kind != INDICATOR_OF_STATE) {
        return roots_guess(0.0, 1.0, step->indicator_row[i]);
    }
    return roots_guess(indicator->offset, indicator->factor, step->row[indicator->state]);
}

/* Returns the place in `used` of the indicator that is likely to fall first, of those whose first[]
 * is 0. */
static size_t likely_first(const struct location *location) {
    size_t likely = 0;
    double soonest = INFINITY;
    for (size_t k = 0; k < location->used_count; k++) {
        const size_t i = location->used[k];
        const double guess = location->first[i] == 0.0 ? guessed_fall(location, i) : INFINITY;
        likely = guess < soonest ? k : likely;
        soonest = guess < soonest ? guess : soonest;
    }
    return likely;
}

/* Searches the polynomials of the indicators whose first[] is 0. Returns the first fall; later ones
 * are not located. */
static double search_polynomials(struct location *location) {
    const bool has_parabola = location->step.degree >= 2 && !location->step.is_from_end;
    const size_t likely = has_parabola ? likely_first(location) : 0;
    double s = INFINITY;
    for (size_t k = 0; k < location->used_count; k++) {
        const size_t i = location->used[k == 0 ? likely : k <= likely ? k - 1 : k];
        if (location->first[i] == 0.0) {
            location->first[i] = location->indicators[i].kind == INDICATOR_OF_STATE
                                     ? first_of_state(location, i, s + same_time)
                                     : first_of_model(location, i, s + largest_correction);
            s = location->first[i] < s ? location->first[i] : s;
        }
    }
    return s;
}

static enum status search_step(struct location *location) {
    const struct step_polynomial *step = &location->step;
    bool needs_search = false;
    bool needs_model = false;
    for (size_t k = 0; k < location->used_count; k++) {
        const size_t i = location->used[k];
        location->first[i] = INFINITY;
        if (location->indicators[i].kind != INDICATOR_OF_STATE && !location->has_row[i]) {
            needs_model = true;
        } else if (location->indicators[i].kind == INDICATOR_OF_STATE &&
                   is_far_above(location, i)) {
            location->is_armed[i] = true;
        } else {
            location->first[i] = 0.0;
            needs_search = true;
        }
    }
    double s = needs_search ? search_polynomials(location) : INFINITY;
    if (needs_model && !stay_calm(location)) {
        struct piece none = {.error = INFINITY};
        const double length = fmin(s + same_time, 1.0);
        const enum status status = search_model_in(location, 0.0, length, 0, &none);
        if (status != STATUS_OK) {
            return status;
        }
        for (size_t k = 0; k < location->used_count; k++) {
            const double first = location->first[location->used[k]];
            s = first < s ? first : s;
        }
    }
    if (!(s <= 1.0)) {
        return STATUS_OK;
    }
    memset(location->triggered, 0, location->ode->indicator_count * sizeof *location->triggered);
    for (size_t k = 0; k < location->used_count; k++) {
        const size_t i = location->used[k];
        location->triggered[i] = location->first[i] <= s + same_time;
    }
    location->time = s == 1.0 ? step->end : step->begin + s * (step->end - step->begin);
    return STATUS_OK;
}

/* Searches a step; takes the search back if it fails or, unless it is `final`, finds no event. */
static enum status attempt(struct location *location, bool is_final) {
    const struct location before = *location;
    for (size_t i = 0; i < location->ode->indicator_count; i++) {
        location->kept[i] = (struct location_kept){location->is_armed[i], location->noise[i],
                                                   location->samples[i][0]};
    }
    const enum status status = search_step(location);
    if (status != STATUS_OK || (!is_final && location->time == INFINITY)) {
        *location = before;
        for (size_t i = 0; i < location->ode->indicator_count; i++) {
            location->is_armed[i] = location->kept[i].is_armed;
            location->noise[i] = location->kept[i].noise;
            location->samples[i][0] = location->kept[i].sample;
        }
    }
    return status;
}

enum status location_search(struct location *location) {
    return location->ode->may_end ? attempt(location, true) : search_step(location);
}

enum status location_try(struct location *location) {
    return attempt(location, false);
}

bool location_touch(struct location *location, double t, const double x[]) {
    bool is_any = false;
    if (!location_is_active(location) || evaluate(location, t, x) != STATUS_OK) {
        return false;
    }
    memset(location->triggered, 0, location->ode->indicator_count * sizeof *location->triggered);
    for (size_t k = 0; k < location->used_count; k++) {
        const size_t i = location->used[k];
        location->triggered[i] = location->indicators[i].kind == INDICATOR_OF_MODEL &&
                                 location->z[i] <= larger(location->error[i], location->touch[i]);
        is_any |= location->triggered[i];
    }
    location->time = is_any ? t : INFINITY;
    return is_any;
}

enum status location_search_at_rest(struct location *location, const double x[], double t) {
    struct step_polynomial *step = &location->step;
    step->begin = 0.0;
    step->end = t;
    step->is_from_end = false;
    step->degree = 0;
    step->row = location->rows;
    for (size_t i = 0; i < location->ode->state_count; i++) {
        step->row[i][0] = x[i];
    }
    return location_search(location);
}
