#include "first_step.h"

#include <math.h>

/* The first step after a restart is of order 1, over the step at which its error estimate would be
 * the tolerance. CVODE's own choice is 0.5 and takes two evaluations to find. The errors of first
 * steps all have the same sign and add up from restart to restart: measured over 2000 steps of 1
 * ms, the error of the trajectory at 0.1 is a third of that at 0.5, for as many internal steps. */
static const double first_step_fraction = 0.1;

/* After an event errors add up in another way: each bounce adds to the error of the height, and the
 * last bounces are as low as the tolerance. So the first steps are short, and do not grow to the
 * tolerance before the order does: bouncing then rests 1.7e-7 s early, as its cut-off says, and not
 * 2.8e-7 s, for 5 % more time. */
static const double first_step_fraction_after_event = 0.003;

/* The error of a first step of order 1 is about h^2 x'' / 2. */
static double step_of_curvature(const struct problem *problem, double fraction, const double x[],
                                const double ddx[]) {
    const double relative = problem->settings.relative_tolerance;
    const double *absolute = problem->settings.absolute_tolerances;
    double sum = 0.0;
    for (size_t i = 0; i < problem->ode.state_count; i++) {
        const double weighted = ddx[i] / (relative * fabs(x[i]) + absolute[i]);
        sum += weighted * weighted;
    }
    const double norm = sqrt(sum / (double)problem->ode.state_count);
    const double step = fraction * sqrt(2.0 / norm);
    return isfinite(step) ? step : 0.0;
}

double first_step_after_restart(const struct problem *problem, const double x[],
                                const double ddx[]) {
    return step_of_curvature(problem, first_step_fraction, x, ddx);
}

/* s: over this time x'' is taken. */
static const double curvature_time = 1e-6;

double first_step_after_event(struct problem *problem, const double x[], double ddx[]) {
    const size_t n = problem->ode.state_count;
    const double ahead = fmin(curvature_time, problem->horizon);
    double *dx = problem->location.x;
    if (problem_rhs(problem, 0.0, x, dx) != STATUS_OK) {
        return 0.0;
    }
    double *moved = problem->location.dx;
    for (size_t i = 0; i < n; i++) {
        moved[i] = x[i] + ahead * dx[i];
    }
    if (problem_rhs(problem, ahead, moved, ddx) != STATUS_OK) {
        return 0.0;
    }
    for (size_t i = 0; i < n; i++) {
        ddx[i] = (ddx[i] - dx[i]) / ahead;
    }
    return step_of_curvature(problem, first_step_fraction_after_event, x, ddx);
}
