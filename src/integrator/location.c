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
    location->rows = calloc(states, sizeof *location->rows);
    location->step.indicator_row = calloc(count, sizeof *location->step.indicator_row);
    location->used = calloc(count, sizeof *location->used);
    location->first = calloc(count, sizeof *location->first);
    location->samples = calloc(count, sizeof *location->samples);
    location->x = calloc(3 * states, sizeof *location->x);
    location->z = calloc(count, sizeof *location->z);
    location->has_row = calloc(count, sizeof *location->has_row);
    location->is_armed = calloc(count, sizeof *location->is_armed);
    location->noise = calloc(3 * count, sizeof *location->noise);
    location->triggered = calloc(count, sizeof *location->triggered);
    if (location->rows == NULL || location->step.indicator_row == NULL || location->used == NULL ||
        location->first == NULL || location->samples == NULL || location->x == NULL ||
        location->z == NULL || location->has_row == NULL || location->is_armed == NULL ||
        location->noise == NULL || location->triggered == NULL) {
        location_destroy(location);
        return false;
    }
    location->touch = location->noise + count;
    location->rounding = location->touch + count;
    location->dx = location->x + states;
    location->restart_x = location->dx + states;
    return true;
}

void location_destroy(struct location *location) {
    free(location->triggered);
    free(location->noise);
    free(location->is_armed);
    free(location->has_row);
    free(location->z);
    free(location->x);
    free(location->samples);
    free(location->first);
    free(location->used);
    free(location->step.indicator_row);
    free(location->rows);
    *location = (struct location){.time = INFINITY};
}

/* Returns the same as fmax, without the call. */
static double larger(double x, double y) {
    return x > y ? x : y;
}

static enum status evaluate(struct location *location, double t, const double x[]) {
    return location->ode->indicators(t, x, location->z, location->ode->context);
}

/* Returns the value of an INDICATOR_OF_STATE. */
static double at_state(const struct indicator *indicator, const double x[]) {
    return indicator->offset + indicator->factor * x[indicator->state];
}

static enum status evaluate_one(struct location *location, size_t i, double t, const double x[],
                                double *z) {
    if (location->indicators[i].kind == INDICATOR_OF_STATE) {
        *z = at_state(&location->indicators[i], x);
        return STATUS_OK;
    }
    const enum status status = evaluate(location, t, x);
    *z = location->z[i];
    return status;
}

/* The rounding of some thousand steps, of one. */
static const double roundings = 0x1p7;

/* Returns the error of a state that no event follows from, in its unit: the tolerance, or the
 * rounding of all steps so far. However small the state is at a restart, it has the error of its
 * usual size: absolute tolerances are relative ones of a hundredth of it. */
static double error_of(const struct location *location, size_t state, double x) {
    const struct integrator_settings *settings = location->settings;
    const double tolerance = settings->absolute_tolerances[state];
    const double usual = 100.0 * tolerance / settings->relative_tolerance;
    return larger(tolerance, 2.0 * roundings * DBL_EPSILON * larger(fabs(x), usual));
}

/* Restarts the indicators of the model, whose noise follows from their limits so far. */
static enum status restart_model(struct location *location, const double x[]) {
    const struct ode *ode = location->ode;
    const enum status status = evaluate(location, 0.0, x);
    if (ode->rounding != NULL) {
        for (size_t i = 0; i < ode->state_count; i++) {
            location->x[i] = 2.0 * DBL_EPSILON * fabs(x[i]);
            location->dx[i] = error_of(location, i, x[i]) / roundings;
        }
        ode->rounding(location->dx, location->touch, ode->context);
        ode->rounding(location->x, location->first, ode->context);
    }
    for (size_t k = 0; status == STATUS_OK && k < location->used_count; k++) {
        const size_t i = location->used[k];
        if (location->indicators[i].kind != INDICATOR_OF_MODEL) {
            continue;
        }
        location->is_armed[i] = location->z[i] > 0.0;
        if (ode->rounding != NULL) {
            location->touch[i] *= roundings;
            location->noise[i] = larger(location->first[i], DBL_MIN);
            location->rounding[i] = location->noise[i];
            location->is_armed[i] = location->z[i] > location->noise[i];
        }
    }
    return status;
}

enum status location_restart(struct location *location, const struct indicator *indicators,
                             const double x[]) {
    location->indicators = indicators;
    location->time = INFINITY;
    if (indicators == NULL) {
        return STATUS_OK;
    }
    bool needs_model = false;
    location->used_count = 0;
    memcpy(location->restart_x, x, location->ode->state_count * sizeof *x);
    for (size_t i = 0; i < location->ode->indicator_count; i++) {
        const struct indicator *indicator = &indicators[i];
        location->has_row[i] = false;
        const bool is_fixed = indicator->kind == INDICATOR_OF_STATE && indicator->factor == 0.0;
        if (indicator->kind == INDICATOR_UNUSED || is_fixed) {
            continue;
        }
        location->used[location->used_count] = i;
        location->used_count++;
        const double rounding = 2.0 * DBL_EPSILON * fabs(indicator->offset);
        if (indicator->kind == INDICATOR_OF_MODEL) {
            needs_model = true;
            location->noise[i] = larger(2.0 * rounding, DBL_MIN);
            location->touch[i] = 2.0 * rounding;
        } else {
            const double z = at_state(indicator, x);
            const bool is_sure = indicator->rises || z > 0.0;
            location->is_armed[i] = is_sure && (z > rounding || (rounding == 0.0 && z >= 0.0));
            const double miss =
                fabs(indicator->factor) * location->settings->absolute_tolerances[indicator->state];
            location->noise[i] = is_sure ? rounding : larger(rounding, miss);
            location->touch[i] = fabs(indicator->factor) *
                                     error_of(location, indicator->state, x[indicator->state]) +
                                 8.0 * DBL_EPSILON * fabs(indicator->offset);
        }
    }
    return needs_model ? restart_model(location, x) : STATUS_OK;
}

/* ---- Falls ---------------------------------------------------------------------------------- */

/* Returns the last fall to 0 up to this s; INFINITY if there is none. */
static double last_fall(const struct roots_polynomial *p, double s) {
    struct root roots[ROOTS_LENGTH];
    const int count = roots_find(p, roots);
    double last = INFINITY;
    for (int i = 0; i < count && roots[i].s <= s; i++) {
        last = roots[i].kind == ROOT_FALLS ? roots[i].s : last;
    }
    return last;
}

/* Returns the first fall to 0 after this s; INFINITY if there is none. */
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
    const double depth = fmax(touch, 2.0 * roundings * DBL_EPSILON * size);
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

/* Returns the first s at which p, below the level before, is above it; INFINITY if it stays below.
 */
static double first_rise(const struct roots_polynomial *p, double level) {
    double c[ROOTS_LENGTH];
    c[0] = level - p->c[0];
    for (int k = 1; k <= p->degree; k++) {
        c[k] = -p->c[k];
    }
    const struct roots_polynomial below = {.c = c, .degree = p->degree, .noise = -1.0};
    return roots_first(&below);
}

/* Returns the first s at which p is below the level; INFINITY if it stays above. */
static double first_below(const struct roots_polynomial *p, double level) {
    double c[ROOTS_LENGTH];
    memcpy(c, p->c, ((size_t)p->degree + 1) * sizeof *c);
    c[0] -= level;
    const struct roots_polynomial above = {.c = c, .degree = p->degree, .noise = -1.0};
    return roots_first(&above);
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
    const bool rises = p->degree > 0 && p->c[0] <= 0.0 && p->c[1] > 0.0;
    if (rises) {
        return fall_behind(p, 0.0);
    }
    return roots_is_above(p) ? INFINITY : p->c[0] > 0.0 ? fall_or_end(p, fall) : roots_first(p);
}

/* Returns fall_first of indicator i; given: the fields of struct fall that do not follow from
 * location. */
static double first_fall(const struct location *location, size_t i,
                         const struct roots_polynomial *p, const struct fall *given) {
    struct fall fall = *given;
    fall.touch = location->touch[i];
    fall.is_armed = &location->is_armed[i];
    fall.noise = &location->noise[i];
    return fall_first(p, &fall);
}

/* ---- Indicators of states ------------------------------------------------------------------- */

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

/* True if the state moves by less than the indicator is above 0 and above its noise at a restart.
 */
static bool is_far_above(const struct step_polynomial *step, const struct indicator *indicator,
                         double value, double noise) {
    const double *row = step->row[indicator->state];
    double way = 0.0;
    for (int k = 1; k <= step->degree; k++) {
        way += fabs(row[k]);
    }
    const double slack = 0x1p-40; // far above all rounding here and in Horner's scheme
    return (1.0 - slack) * value > (1.0 + slack) * fabs(indicator->factor) * way + noise;
}

static double first_of_state(struct location *location, size_t i, double latest) {
    const struct step_polynomial *step = &location->step;
    const struct indicator *indicator = &location->indicators[i];
    double c[ROOTS_LENGTH];
    c[0] = indicator->offset + indicator->factor * step->row[indicator->state][0];
    if (is_far_above(step, indicator, c[0], location->is_armed[i] ? 0.0 : location->noise[i])) {
        location->is_armed[i] = true;
        return INFINITY;
    }
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
    return first_fall(location, i, &p,
                      &(struct fall){.latest = latest, .is_restart = step->begin == 0.0});
}

/* ---- Steps of states ------------------------------------------------------------------------ */

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

void location_lead_from_restart(struct location *location) {
    const struct step_polynomial *step = &location->step;
    for (size_t i = 0; i < location->ode->state_count; i++) {
        double value = 0.0; // value at s = -1
        for (int k = step->degree; k >= 0; k--) {
            value = step->row[i][k] - value;
        }
        step->row[i][1] -= location->restart_x[i] - value;
    }
}

/* ---- Indicators of the model ---------------------------------------------------------------- */

/* Largest error of a polynomial that represents an indicator, relative to the values' scale. */
static const double representation = 1e-12;

/* Returns the first fall of an indicator of the model whose polynomial is given. */
static double first_of_model(struct location *location, size_t i, double latest) {
    const struct step_polynomial *step = &location->step;
    const struct roots_polynomial p = {step->indicator_row[i], step->degree, -1.0};
    double size = 0.0;
    for (int k = 0; k <= step->degree; k++) {
        size += fabs(p.c[k]);
    }
    return first_fall(location, i, &p,
                      &(struct fall){.error = representation * size,
                                     .latest = latest,
                                     .is_restart = step->begin == 0.0});
}

/* Writes all indicators at s of the whole step to column k of samples. */
static enum status sample(struct location *location, double s, int k) {
    const struct step_polynomial *step = &location->step;
    location_write_states(location, s, location->x);
    const double t = step->begin + s * (step->end - step->begin);
    const enum status status = evaluate(location, t, location->x);
    for (size_t i = 0; status == STATUS_OK && i < location->ode->indicator_count; i++) {
        location->samples[i][k] = location->z[i];
    }
    return status;
}

/* A part of a step. */
struct piece {
    double begin; /* s */
    double length;
    int count; /* number of points sampled */
};

/* Samples between the points of the piece, which then has 2 count - 1 points. */
static enum status sample_between(struct location *location, struct piece *piece) {
    const int count = 2 * piece->count - 1;
    for (size_t i = 0; i < location->ode->indicator_count; i++) {
        for (int k = piece->count - 1; k > 0; k--) {
            const int twice = 2 * k;
            location->samples[i][twice] = location->samples[i][k];
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
    *piece = (struct piece){begin, length, FEWEST_POINTS};
    enum status status = STATUS_OK;
    for (int k = 0; status == STATUS_OK && k < FEWEST_POINTS; k++) {
        status = sample(location, begin + length * chebyshev_point(FEWEST_POINTS, k), k);
    }
    return status;
}

static double largest(const double samples[], int count) {
    double scale = 0.0;
    for (int k = 0; k < count; k++) {
        scale = larger(fabs(samples[k]), scale);
    }
    return scale;
}

/* Searches one indicator in a piece. Returns false if the piece needs more points. */
static bool search_piece(struct location *location, const struct piece *piece, size_t i,
                         bool is_last_try) {
    double c[ROOTS_LENGTH] = {0};
    const double error = chebyshev_interpolate(piece->count, location->samples[i], c);
    const double size = largest(location->samples[i], piece->count);
    const double noise = larger(representation * size, location->rounding[i]);
    const bool is_exact = error <= noise;
    const int degree = piece->count - 1;
    if (!is_exact && !is_last_try) {
        // far enough above 0
        c[0] -= 16.0 * error;
        const bool is_above = roots_is_above(&(struct roots_polynomial){c, degree, -1.0});
        location->is_armed[i] |= is_above;
        return is_above;
    }
    const struct roots_polynomial p = {c, degree, -1.0};
    const bool is_restart = location->step.begin == 0.0 && piece->begin == 0.0;
    const double s =
        first_fall(location, i, &p,
                   &(struct fall){.error = noise, .latest = INFINITY, .is_restart = is_restart});
    location->first[i] = fmin(location->first[i], piece->begin + piece->length * s);
    return true;
}

/* Shortest piece of a step: a step is divided in two until polynomials represent all indicators. */
static const double shortest_piece = 0x1p-10;

/* Searches the indicators from number `from` on. */
static enum status search_model_in(struct location *location, double begin, double length,
                                   size_t from) {
    struct piece piece;
    enum status status = begin_piece(location, begin, length, &piece);
    size_t i = from;
    while (status == STATUS_OK && i < location->ode->indicator_count) {
        const bool is_last_try = piece.count == CHEBYSHEV_LENGTH && length <= shortest_piece;
        const bool is_wanted = location->indicators[i].kind == INDICATOR_OF_MODEL &&
                               !location->has_row[i] && location->first[i] > begin;
        if (!is_wanted || search_piece(location, &piece, i, is_last_try)) {
            i++;
        } else if (piece.count < CHEBYSHEV_LENGTH) {
            status = sample_between(location, &piece);
        } else {
            status = search_model_in(location, begin, 0.5 * length, i);
            if (status == STATUS_OK) {
                status = search_model_in(location, begin + 0.5 * length, 0.5 * length, i);
            }
            break;
        }
    }
    return status;
}

/* ---- Steps ---------------------------------------------------------------------------------- */

/* True if the last terms are small and the sum has the value z at the end of the step. */
static bool is_converged(const double c[], int degree, double z, double relative_tolerance) {
    double sum = 0.0;
    double size = 0.0;
    for (int k = degree; k >= 0; k--) {
        sum += c[k];
        size += fabs(c[k]);
    }
    const double last = degree > 0 ? fabs(c[degree - 1]) + fabs(c[degree]) : 0.0;
    return isfinite(size) && last + fabs(sum - z) <= relative_tolerance * size;
}

void location_check_rows(struct location *location, const double x[], double relative_tolerance) {
    const struct step_polynomial *step = &location->step;
    bool has_any = false;
    for (size_t k = 0; k < location->used_count; k++) {
        has_any |= location->has_row[location->used[k]];
    }
    if (!has_any || evaluate(location, step->end, x) != STATUS_OK) {
        return;
    }
    for (size_t k = 0; k < location->used_count; k++) {
        const size_t i = location->used[k];
        location->has_row[i] =
            location->has_row[i] &&
            is_converged(step->indicator_row[i], step->degree, location->z[i], relative_tolerance);
    }
}

/* Part of a step within which roots of several indicators are one event. */
static const double same_time = 4.0 * 0x1p-52;

enum status location_search(struct location *location) {
    const struct step_polynomial *step = &location->step;
    bool needs_model = false;
    double s = INFINITY; // first event so far: no later one is located
    for (size_t k = 0; k < location->used_count; k++) {
        const size_t i = location->used[k];
        const struct indicator *indicator = &location->indicators[i];
        location->first[i] = INFINITY;
        if (indicator->kind == INDICATOR_OF_STATE) {
            location->first[i] = first_of_state(location, i, s + same_time);
        } else if (location->has_row[i]) {
            location->first[i] = first_of_model(location, i, s + same_time);
        }
        s = location->first[i] < s ? location->first[i] : s;
        needs_model |= indicator->kind == INDICATOR_OF_MODEL && !location->has_row[i];
    }
    if (needs_model) {
        const enum status status = search_model_in(location, 0.0, 1.0, 0);
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

void location_write_cubic(struct location *location, double begin, const double begin_x[],
                          const double begin_dx[], double end, const double x[],
                          const double dx[]) {
    struct step_polynomial *step = &location->step;
    const double h = end - begin;
    step->begin = begin;
    step->end = end;
    step->is_from_end = false;
    step->degree = 3;
    step->row = location->rows;
    for (size_t i = 0; i < location->ode->state_count; i++) {
        const double change = x[i] - begin_x[i];
        const double first = h * begin_dx[i];
        const double last = h * dx[i];
        step->row[i][0] = begin_x[i];
        step->row[i][1] = first;
        step->row[i][2] = 3.0 * change - 2.0 * first - last;
        step->row[i][3] = first + last - 2.0 * change;
    }
}

bool location_correction(struct location *location, double t, const double x[], const double dx[],
                         double *z, double *correction) {
    size_t i = 0;
    while (!location->triggered[i]) {
        i++;
    }
    if (evaluate_one(location, i, t, x, z) != STATUS_OK) {
        return false;
    }
    // over so small a part of the step the derivative of an indicator hardly changes; the part is
    // longer if the difference is lost in rounding
    double z_ahead = *z;
    double ahead = 0x1p-20 * (location->step.end - location->step.begin);
    for (int tries = 0; z_ahead == *z && tries < 4; tries++) {
        for (size_t j = 0; j < location->ode->state_count; j++) {
            location->x[j] = x[j] + ahead * dx[j];
        }
        if (evaluate_one(location, i, t + ahead, location->x, &z_ahead) != STATUS_OK) {
            return false;
        }
        *correction = -*z * ahead / (z_ahead - *z);
        ahead *= 0x1p4;
    }
    return isfinite(*correction);
}
