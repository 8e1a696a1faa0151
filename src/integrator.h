/* Integration of an ode by SUNDIALS CVODE (Adams-Moulton, fixed-point iteration), which stays
 * behind this handle: no type or message of SUNDIALS leaves it.
 *
 * Time here is counted from the last restart, so that its rounding does not grow with the time of
 * the simulation. CVODE steps past the points asked for and interpolates; a restart drops what lies
 * beyond. One handle serves one thread at a time; handles share nothing. */
#ifndef INTEGRATOR_H
#define INTEGRATOR_H

#include "message.h"
#include "ode.h"

struct integrator;

struct integrator_settings {
    double relative_tolerance;         /* > 0, of every internal step */
    const double *absolute_tolerances; /* > 0, one per state in its unit; copied */
};

/* Totals since integrator_configure, and the last internal step. */
struct integrator_statistics {
    long steps;           /* internal steps */
    long rhs_evaluations; /* calls of the right-hand side */
    long failed_steps;    /* attempts that the error test or the iteration refused */
    long restarts;
    double last_step; /* s: length of the last internal step */
    int last_order;   /* its order */
};

/* Allocates all that integration needs; nothing is allocated later. ode and sink are copied, what
 * they point to must outlive the handle. On failure *integrator is NULL. */
__attribute__((nonnull, warn_unused_result)) enum status
integrator_create(const struct ode *ode, const struct message_sink *sink,
                  struct integrator **integrator);

/* NULL is allowed. */
void integrator_destroy(struct integrator *integrator);

/* Sets tolerances and clears the statistics. A restart must follow. */
__attribute__((nonnull, warn_unused_result)) enum status
integrator_configure(struct integrator *integrator, const struct integrator_settings *settings);

/* Starts anew from x at time 0 with no history. span (> 0): the right-hand side is not evaluated at
 * times beyond it, nor may integrator_advance go there; INFINITY where there is no such limit. */
__attribute__((nonnull, warn_unused_result)) enum status
integrator_restart(struct integrator *integrator, const double x[], double span);

/* Integrates to the time t, not before the one of the last call, in max_steps (>= 1) internal steps
 * at most, and writes the state there to x.
 * Where that fails (STATUS_TOO_MANY_STEPS, STATUS_NO_CONVERGENCE, STATUS_NOT_FINITE), *reached <= t
 * is the last time with a valid state and x that state; on success *reached is t.
 *
 * What follows a restart is a function of its state and span and of the first t after it, which
 * bounds the first internal step; at which further times there was a stop does not matter. */
__attribute__((nonnull, warn_unused_result)) enum status
integrator_advance(struct integrator *integrator, double t, long max_steps, double *reached,
                   double x[]);

__attribute__((nonnull)) void integrator_get_statistics(const struct integrator *integrator,
                                                        struct integrator_statistics *statistics);

/* Overwrites the totals, so that what was only done again does not count. */
__attribute__((nonnull)) void
integrator_set_statistics(struct integrator *integrator,
                          const struct integrator_statistics *statistics);

#endif
