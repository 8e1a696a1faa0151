/* Integrates an ode by SUNDIALS or by Taylor series. SUNDIALS stays behind this handle: none of its
 * types or messages appears here.
 *
 * Time is counted from the last restart, so that its rounding does not grow with the time of the
 * simulation. CVODE steps past the requested times and interpolates; a restart drops the rest of
 * such a step. The Runge-Kutta method ends its steps at the requested times and has no history. The
 * Taylor method does so too, unless a restart continues the same solution. One handle serves one
 * thread at a time; handles share nothing. */
#pragma once

#include "ode.h"
#include "platform.h"

#include <stdbool.h>
#include <stdint.h>

struct integrator;

/* Returns the name of the method, as in the variable solver_method. */
const char *integrator_method_name(enum integrator_method method);

/* Returns the fraction of a tolerance at which the method must run to keep that tolerance over
 * thousands of restarts. */
double integrator_tolerance_fraction(enum integrator_method method);

/* Returns the number of internal steps after which the integrator is to be restarted although
 * nothing has changed: a replay repeats no more. 0 for a method without history: each advance
 * starts fresh, and a restart between two advances changes nothing. */
int64_t integrator_longest_history(enum integrator_method method, bool has_events);

/* True if the method can integrate the ode: all can but INTEGRATOR_TAYLOR, which needs the series.
 */
NONNULL bool integrator_is_possible(enum integrator_method method, const struct ode *ode);

/* Creates a handle. ode and sink are copied; the data behind their pointers must outlive the
 * handle. On failure *integrator is NULL. */
MUST_CHECK NONNULL enum status integrator_create(const struct ode *ode,
                                                 const struct message_sink *sink,
                                                 struct integrator **integrator);

/* Frees the handle; it may be NULL. */
void integrator_destroy(struct integrator *integrator);

/* Sets method, tolerances and limits and clears the statistics. A new method gets all its memory
 * here, from the workspace of the handle, which cannot fail; nothing is allocated later. A restart
 * must follow. After a failure it must be called again. */
MUST_CHECK NONNULL enum status integrator_configure(struct integrator *integrator,
                                                    const struct integrator_settings *settings);

/* Starts from x at time 0 without history. */
MUST_CHECK NONNULL enum status integrator_restart(struct integrator *integrator, const double x[],
                                                  const struct integrator_start *start);

/* Returns, after an advance, how long a first internal step can be after a restart here, s; 0 if
 * unknown. */
NONNULL double integrator_next_step(const struct integrator *integrator);

/* Returns, after an advance, the end of the last internal step, s since the restart.
 * integrator_interpolate gives states up to there. */
NONNULL double integrator_passed_time(const struct integrator *integrator);

/* Sets the observer of the next advances; NULL for none. Watching changes neither states nor
 * internal steps; a method may evaluate the right-hand side more often. */
NONNULL_ARGUMENTS(1)
void integrator_set_observer(struct integrator *integrator, integrator_observer *observer,
                             void *context);

/* Does the same as integrator_advance if an internal step has passed t already; otherwise returns
 * false and does nothing. */
MUST_CHECK NONNULL bool integrator_interpolate(struct integrator *integrator, double t, double x[]);

/* Integrates to the time t, not before the t of the last call, in max_steps (>= 1) internal steps
 * at most, and writes the state there to x. On success *reached is t, or the time at which an event
 * or the observer ended the advance. On failure (STATUS_TOO_MANY_STEPS, STATUS_NO_CONVERGENCE,
 * STATUS_NOT_FINITE), *reached <= t is the last time with a valid state and x that state.
 *
 * Deterministic: after a restart, results depend only on its arguments and the first t, which
 * bounds the first internal step, unless the restart has events and continues. With a history,
 * stops at further times do not matter, as long as it is not longer than
 * integrator_longest_history. */
MUST_CHECK NONNULL enum status integrator_advance(struct integrator *integrator, double t,
                                                  int64_t max_steps, double *reached, double x[]);

/* Searches the time to t for an event while no state moves from x, in place of a restart and an
 * advance. Writes t or the time of the event to *reached, as integrator_advance does; counts
 * nothing. A restart must follow. */
MUST_CHECK NONNULL enum status integrator_rest(struct integrator *integrator, const double x[],
                                               const struct integrator_start *start, double t,
                                               double *reached);

/* Returns, if the last advance ended at an event, which indicators are at 0, a flag each; otherwise
 * NULL. After an event the next call must be a restart. */
NONNULL const bool *integrator_event(const struct integrator *integrator);

/* True if indicators are at 0, within their errors, where an advance has failed: a mode may have no
 * solution beyond its limit. Then that is an event, as of integrator_event. */
NONNULL bool integrator_touches(struct integrator *integrator);

/* Returns the state at which the equations were last found not finite since the restart, and
 * writes its time (s since the restart); NULL if there is none. */
NONNULL const double *integrator_failure(const struct integrator *integrator, double *t);

/* True if an advance that has taken too many steps probably did so because the problem is stiff.
 * Evaluates the right-hand side. integrator_failure forgets its state. */
NONNULL bool integrator_seems_stiff(struct integrator *integrator);

/* Returns the totals. The caller may overwrite them, so that repeated work does not count. */
NONNULL struct integrator_statistics *integrator_totals(struct integrator *integrator);
