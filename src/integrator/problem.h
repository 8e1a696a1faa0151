/* An initial value problem as a method of integration sees it: the ode with its settings, the
 * limits since the last restart, and a count of evaluations. */
#ifndef PROBLEM_H
#define PROBLEM_H

#include "integrator.h"
#include "location.h"

/* Times in s since the last restart. */
struct problem {
    struct message_sink sink;
    struct ode ode;
    struct integrator_settings settings;
    double origin;            /* time of the simulation at the restart, s: for messages only */
    double horizon;           /* the right-hand side is not evaluated beyond */
    double first_step;        /* length of the first internal step, s; 0: the method finds one */
    bool continues;           /* as in struct integrator_start */
    double reached;           /* where the last advance ended; 0 after a restart */
    double failed_at;         /* last time at which the right-hand side failed; -INFINITY: none */
    int64_t evaluation_count; /* calls of the right-hand side; series begun */
    integrator_observer *observer; /* NULL: none */
    void *observer_context;
    struct location location;
};

/* Whether the observer ends the advance at t, the end of an internal step, where the state is x. */
static inline bool problem_ends_at(const struct problem *problem, double t, const double x[]) {
    return problem->observer(problem->observer_context, t, x);
}

/* All values are finite: 0 x is 0 for finite values only. */
static inline bool problem_are_finite(const double values[], size_t count) {
    double sum = 0.0;
    for (size_t i = 0; i < count; i++) {
        sum += 0.0 * values[i];
    }
    return sum == 0.0;
}

/* Writes f(t, x) to dx; STATUS_NOT_FINITE if that fails or is not finite. Inline, as these calls
 * are most of a step. */
static inline enum status problem_rhs(struct problem *problem, double t, const double x[],
                                      double dx[]) {
    const struct ode *ode = &problem->ode;
    problem->evaluation_count++;
    if (ode->rhs(t, x, dx, ode->context) == STATUS_OK && problem_are_finite(dx, ode->state_count)) {
        return STATUS_OK;
    }
    problem->failed_at = t;
    return STATUS_NOT_FINITE;
}

/* Writes the Jacobian as in ode.h; fails as problem_rhs. */
static inline enum status problem_jacobian(struct problem *problem, double t, const double x[],
                                           double J[]) {
    const struct ode *ode = &problem->ode;
    if (ode->jacobian(t, x, J, ode->context) == STATUS_OK &&
        problem_are_finite(J, ode->state_count * ode->state_count)) {
        return STATUS_OK;
    }
    problem->failed_at = t;
    return STATUS_NOT_FINITE;
}

/* Writes coefficients as in ode.h; the orders from 0 on count as an evaluation. Fails as
 * problem_rhs; whether they are finite is for the caller to see. */
static inline enum status problem_series(struct problem *problem, double t, double time_scale,
                                         int first, int last, double rows[][SERIES_LENGTH]) {
    const struct ode *ode = &problem->ode;
    problem->evaluation_count += first == 0 ? 1 : 0;
    if (ode->series(t, time_scale, first, last, rows, ode->context) == STATUS_OK) {
        return STATUS_OK;
    }
    problem->failed_at = t;
    return STATUS_NOT_FINITE;
}

/* Stuck in front of a time at which the right-hand side cannot be evaluated. */
static inline bool problem_is_stuck(const struct problem *problem) {
    return problem->failed_at >= problem->reached;
}

#endif
