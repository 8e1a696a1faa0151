/* What the tests of the integrator share: settings, and a circle to integrate. */
#ifndef INTEGRATOR_TEST_H
#define INTEGRATOR_TEST_H

#include "integrator.h"
#include "last_text.h"

#include <math.h>
#include <string.h>
#include <unity.h>

/* The absolute tolerances, of up to four states, are a hundredth of the relative one. */
static inline void configure_integrator(struct integrator *of, int chosen, double tolerance,
                                        double max_step) {
    const double least = 1e-2 * tolerance;
    const double absolute[4] = {least, least, least, least};
    const struct integrator_settings settings = {.method = (enum integrator_method)chosen,
                                                 .relative_tolerance = tolerance,
                                                 .absolute_tolerances = absolute,
                                                 .max_step = max_step};
    ASSERT_OK(integrator_configure(of, &settings));
}

/* x' = v, v' = -x, until failing_from, from where on the right-hand side gives NaN. */
struct circle {
    double latest; /* s: latest time requested */
    double failing_from;
    long evaluations;
};

static inline enum status circle_rhs(double t, const double x[], double dx[], void *context) {
    struct circle *of = context;
    of->latest = fmax(of->latest, t);
    of->evaluations++;
    dx[0] = x[1];
    dx[1] = t >= of->failing_from ? NAN : -x[0];
    return STATUS_OK;
}

static inline enum status circle_jacobian(double t, const double x[], double J[], void *context) {
    static const double columns[4] = {0.0, -1.0, 1.0, 0.0};
    memcpy(J, columns, sizeof columns);
    return STATUS_OK;
}

static inline enum status circle_series(double t, double time_scale, int first, int last,
                                        double row[][SERIES_LENGTH], void *context) {
    struct circle *of = context;
    of->latest = fmax(of->latest, t);
    of->evaluations += first == 0 ? 1 : 0;
    for (int k = first > 0 ? first : 1; k <= last; k++) {
        row[0][k] = time_scale / k * row[1][k - 1];
        row[1][k] = t >= of->failing_from ? NAN : -time_scale / k * row[0][k - 1];
    }
    return STATUS_OK;
}

#endif
