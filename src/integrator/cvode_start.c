/* CVODE begins with order 1, and needs some forty steps until orders and lengths are those of the
 * motion. Its Nordsieck array has the derivatives over the factorials, times powers of the length:
 * the terms of a Taylor series. There is no function of CVODE to write it. */
#include "cvode_start.h"

#include "small_vector.h"
#include "taylor_series.h"

#include <cvode/cvode_impl.h>
#include <math.h>

/* Order of the first step, and (order + 1)! times the constant of its error (Hairer, Norsett and
 * Wanner, Solving Ordinary Differential Equations I, section III.2: 3/160). */
enum { ORDER = 5 };
static const double error_constant = 13.5;

/* Error of the first step, in tolerances. */
static const double first_error = 1e-2;

/* Longest first step, over the time in which the term of order 2 comes to the tolerance. */
static const double most_times = 1000.0;

/* Time scale of the series, s: any at which its terms do not overflow. */
static const double time_scale = 1e-3;

/* Returns the norm of the coefficients of an order, in tolerances, as CVODE's. */
static double norm_of(const struct problem *problem, double row[][SERIES_LENGTH], int order) {
    const double relative = problem->settings.relative_tolerance;
    const double *absolute = problem->settings.absolute_tolerances;
    const size_t n = problem->ode.state_count;
    double sum = 0.0;
    for (size_t i = 0; i < n; i++) {
        const double size = row[i][order] / (relative * fabs(row[i][0]) + absolute[i]);
        sum += size * size;
    }
    return sqrt(sum / (double)n);
}

double cvode_start(void *solver, struct problem *problem, const double x[],
                   double row[][SERIES_LENGTH]) {
    const struct ode *ode = &problem->ode;
    CVodeMem memory = solver;
    for (size_t i = 0; i < ode->state_count; i++) {
        row[i][0] = x[i];
    }
    problem->evaluation_count++;
    if (ode->series(0.0, time_scale, 0, ORDER + 1, row, ode->context) != STATUS_OK) {
        return 0.0;
    }
    const double bent = norm_of(problem, row, 2);
    const double error = error_constant / first_error * norm_of(problem, row, ORDER + 1);
    const double longest = fmin(most_times / sqrt(bent), pow(error, -1.0 / (ORDER + 1)));
    const double max_step = problem->settings.max_step;
    const double past_event =
        taylor_series_guess_passed * taylor_series_guess_event(problem, row, 0.0);
    double h = fmin(fmin(longest, past_event) * time_scale, problem->horizon * (1.0 - 0x1p-40));
    h = max_step > 0.0 ? fmin(h, max_step) : h;
    if (!(h > 0.0 && isfinite(h) && isfinite(bent) && isfinite(error))) {
        return 0.0;
    }
    double power = h / time_scale;
    for (int k = 2; k <= ORDER; k++) {
        double *column = small_vector_data(memory->cv_zn[k]);
        power *= h / time_scale;
        for (size_t i = 0; i < ode->state_count; i++) {
            column[i] = power * row[i][k];
        }
        memory->cv_tau[k - 1] = h;
    }
    memory->cv_q = ORDER;
    memory->cv_L = ORDER + 1;
    memory->cv_qwait = memory->cv_L;
    return h;
}
