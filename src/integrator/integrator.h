/* Integration of an ode, by SUNDIALS or by Taylor series. SUNDIALS stays behind this handle: no
 * type or message of it leaves.
 *
 * Time is counted from the last restart, so that its rounding does not grow with the time of the
 * simulation. CVODE steps past the requested times and interpolates; a restart drops what lies
 * beyond. The Runge-Kutta method ends its steps at the requested times and has no history. The
 * Taylor method does so too, unless a restart continues the same solution. One handle serves
 * one thread at a time; handles share nothing. */
#ifndef INTEGRATOR_H
#define INTEGRATOR_H

#include "ode.h"
#include "platform.h"

#include <stdbool.h>
#include <stdint.h>

struct integrator;

/* As in the variable solver_method. */
const char *integrator_method_name(enum integrator_method method);

/* A method keeps a tolerance over thousands of restarts if it runs at this fraction of it. */
double integrator_tolerance_fraction(enum integrator_method method);

/* Internal steps after which the integrator is to be restarted though nothing has changed, the most
 * that a replay repeats; 0: the method has no history, each advance starts fresh, and a restart
 * between two of them changes nothing. */
int64_t integrator_longest_history(enum integrator_method method, bool has_events);

/* Whether the method can integrate the ode: all but INTEGRATOR_TAYLOR can, which needs its series.
 */
NONNULL bool integrator_is_possible(enum integrator_method method, const struct ode *ode);

/* ode and sink are copied, what they point to must outlive the handle. On failure *integrator is
 * NULL. */
MUST_CHECK NONNULL enum status integrator_create(const struct ode *ode,
                                                 const struct message_sink *sink,
                                                 struct integrator **integrator);

/* NULL is allowed. */
void integrator_destroy(struct integrator *integrator);

/* Sets method, tolerances and limits and clears the statistics. Allocates all that the method
 * needs, where it is not the one before, from the workspace of the handle, which cannot fail;
 * nothing is allocated later. A restart must follow. On failure it must be called again. */
MUST_CHECK NONNULL enum status integrator_configure(struct integrator *integrator,
                                                    const struct integrator_settings *settings);

/* Starts from x at time 0 with no history. */
MUST_CHECK NONNULL enum status integrator_restart(struct integrator *integrator, const double x[],
                                                  const struct integrator_start *start);

/* After an advance: how long a first internal step can be after a restart here, s; 0: unknown. */
NONNULL double integrator_next_step(const struct integrator *integrator);

/* After an advance: where the last internal step ended, s since the restart. Up to there
 * integrator_interpolate gives states. */
NONNULL double integrator_passed_time(const struct integrator *integrator);

/* Of the next advances; NULL: none. Watching changes neither states nor internal steps; a method
 * may evaluate the right-hand side more often. */
NONNULL_ARGUMENTS(1)
void integrator_set_observer(struct integrator *integrator, integrator_observer *observer,
                             void *context);

/* As integrator_advance where an internal step has passed t already. Otherwise false, with nothing
 * done. */
MUST_CHECK NONNULL bool integrator_interpolate(struct integrator *integrator, double t, double x[]);

/* Integrates to the time t, not before the one of the last call, in max_steps (>= 1) internal steps
 * at most, and writes the state there to x.
 * Where that fails (STATUS_TOO_MANY_STEPS, STATUS_NO_CONVERGENCE, STATUS_NOT_FINITE), *reached <= t
 * is the last time with a valid state and x that state; on success *reached is t, or where an event
 * or the observer ended the advance.
 *
 * Deterministic: after a restart, results depend only on its arguments and the first t, which
 * bounds the first internal step, unless the restart has events and continues. With a history,
 * stops at further times do not matter, as long as it is not longer than
 * integrator_longest_history. */
MUST_CHECK NONNULL enum status integrator_advance(struct integrator *integrator, double t,
                                                  int64_t max_steps, double *reached, double x[]);

/* Instead of a restart and an advance, where no state moves: searches the time to t for an event,
 * with the states x. Writes t or the time of the event to *reached, as integrator_advance; counts
 * nothing. A restart must follow. */
MUST_CHECK NONNULL enum status integrator_rest(struct integrator *integrator, const double x[],
                                               const struct integrator_start *start, double t,
                                               double *reached);

/* Where the last advance ended at an event: which indicators are at 0, one flag each; otherwise
 * NULL. The next call must be a restart. */
NONNULL const bool *integrator_event(const struct integrator *integrator);

NONNULL void integrator_get_statistics(const struct integrator *integrator,
                                       struct integrator_statistics *statistics);

/* Overwrites the totals, so that what was only done again does not count. */
NONNULL void integrator_set_statistics(struct integrator *integrator,
                                       const struct integrator_statistics *statistics);

#endif
