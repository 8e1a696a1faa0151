#include "tangent.h"

#include <math.h>

static int rate(const struct tangent *tangent, struct fmu *fmu, const double deviation[],
                double result[]) {
    return fmu_get_derivative(fmu, tangent->count, tangent->derivatives, tangent->states, deviation,
                              result);
}

/* Reads discrete outputs, and finds whether one differs from before. */
static int changes(struct tangent *tangent, struct fmu *fmu, bool *has_changed) {
    *has_changed = false;
    double *const now = tangent->real_values;
    double *const before = now + tangent->real_count;
    for (int64_t k = 0; k < tangent->real_count; k++) {
        before[k] = now[k];
    }
    int status = fmu_get_reals(fmu, tangent->real_count, tangent->reals, now);
    for (int64_t k = 0; status < FMU_DISCARD && k < tangent->real_count; k++) {
        *has_changed = *has_changed || now[k] != before[k];
    }
    for (int64_t k = 0; status < FMU_DISCARD && k < tangent->integer_count; k++) {
        int64_t value = 0;
        status =
            fmu_get_discrete(fmu, (struct fmu_variable){tangent->integers[k], FMU_INTEGER}, &value);
        *has_changed = *has_changed || value != tangent->integer_values[k];
        tangent->integer_values[k] = value;
    }
    return status;
}

/* Scales to length 1 and returns the length before. */
static double normalize(int64_t count, double x[]) {
    double total = 0.0;
    for (int64_t k = 0; k < count; k++) {
        total += x[k] * x[k];
    }
    const double length = __builtin_sqrt(total);
    for (int64_t k = 0; k < count; k++) {
        x[k] /= length;
    }
    return length;
}

int tangent_begin(struct tangent *tangent, struct fmu *fmu) {
    bool has_changed;
    int status = FMU_OK;
    if (!tangent->has_begun) {
        tangent->has_begun = 1;
        status = changes(tangent, fmu, &has_changed);
    }
    return status < FMU_DISCARD ? rate(tangent, fmu, tangent->deviation, tangent->rate) : status;
}

int tangent_end(struct tangent *tangent, struct fmu *fmu, double length, double *growth) {
    double *const x = tangent->deviation;
    double *const predicted = tangent->predicted;
    for (int64_t k = 0; k < tangent->count; k++) {
        predicted[k] = x[k] + length * tangent->rate[k];
    }
    int status = rate(tangent, fmu, predicted, tangent->rate);
    if (status >= FMU_DISCARD) {
        return status;
    }
    for (int64_t k = 0; k < tangent->count; k++) {
        x[k] = 0.5 * (x[k] + predicted[k] + length * tangent->rate[k]);
    }
    *growth = normalize(tangent->count, x);
    bool has_changed;
    status = changes(tangent, fmu, &has_changed);
    if (has_changed) {
        *growth = NAN;
    }
    return status;
}
