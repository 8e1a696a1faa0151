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
    location->rows = calloc(states + count, sizeof *location->rows);
    location->samples = calloc(count, sizeof *location->samples);
    location->x = calloc(3 * states + 6 * count, sizeof *location->x);
    location->used = calloc(count, sizeof *location->used);
    location->is_armed = calloc(3 * count, sizeof *location->is_armed);
    location->kept = calloc(count, sizeof *location->kept);
    if (location->rows == NULL || location->samples == NULL || location->x == NULL ||
        location->used == NULL || location->is_armed == NULL || location->kept == NULL) {
        location_destroy(location);
        return false;
    }
    location->step.indicator_row = location->rows + states;
    location->dx = location->x + states;
    location->restart_x = location->dx + states;
    location->z = location->restart_x + states;
    location->first = location->z + count;
    location->noise = location->first + count;
    location->touch = location->noise + count;
    location->rounding = location->touch + count;
    location->error = location->rounding + count;
    location->has_row = location->is_armed + count;
    location->triggered = location->has_row + count;
    return true;
}

void location_destroy(struct location *location) {
    free(location->kept);
    free(location->is_armed);
    free(location->used);
    free(location->x);
    free(location->samples);
    free(location->rows);
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
    if (ode->rounding != NULL) {
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
        location->touch[i] *= ode->rounding != NULL ? falls_roundings : 1.0;
        if (location->indicators[i].kind != INDICATOR_OF_MODEL) {
            continue;
        }
        location->is_armed[i] = location->z[i] > 0.0;
        location->samples[i][0] = location->z[i];
        location->calm_end = 0.0;
        if (ode->rounding != NULL) {
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
            const double z = indicator_at_state(indicator, x);
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
