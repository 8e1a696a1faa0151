/* An initial value problem as a method of integration sees it: the ode with its settings, the
 * limits since the last restart, and a count of evaluations. */
#ifndef PROBLEM_H
#define PROBLEM_H

#include "integrator.h"

/* Times in s since the last restart. */
struct problem {
    struct ode ode;
    struct message_sink sink;
    struct integrator_settings settings;
    double span;           /* the right-hand side is not evaluated beyond */
    double first_step;     /* length of the first internal step, s; 0: the method finds one */
    double reached;        /* where the last advance ended; 0 after a restart */
    double failed_at;      /* last time at which the right-hand side failed; -INFINITY: none */
    long evaluation_count; /* calls of the right-hand side */
};

/* Writes f(t, x) to dx; STATUS_NOT_FINITE where that fails or is not finite. */
MUST_CHECK NONNULL enum status problem_rhs(struct problem *problem, double t, const double x[],
                                           double dx[]);

/* Writes the Jacobian as in ode.h; fails as problem_rhs. */
MUST_CHECK NONNULL enum status problem_jacobian(struct problem *problem, double t, const double x[],
                                                double J[]);

/* Stuck in front of a time at which the right-hand side cannot be evaluated. */
NONNULL bool problem_is_stuck(const struct problem *problem);

/* All values are finite. */
NONNULL bool problem_are_finite(const double values[], size_t count);

#endif
