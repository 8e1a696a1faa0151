/* History of the integrator's internal steps: when it may continue, how a restored instance gets
 * its history back, and the initial value problem: the model with the parameters of the last
 * restart, and the inputs as polynomials since then. */
#pragma once

#include "state.h"

/* Way in which the integrator continues. */
enum continuation {
    CONTINUE_NOW,           /* from its history */
    CONTINUE_AFTER_REPLAY,  /* from its history, which a restored instance repeats first */
    CONTINUE_AFTER_RESTART, /* on the same motion: the history has become too long */
    CONTINUE_AFTER_CHANGE,  /* with a restart: an input or a parameter has changed */
    CONTINUE_AFTER_EVENT,   /* with a restart, in the modes after an event */
};

/* Returns how the integrator continues to target (s since the restart). */
MUST_CHECK NONNULL enum continuation instance_continuation(const struct instance *instance,
                                                           double target);

/* Returns how far from a restart the integrator may go, s: to target if inputs move, otherwise to
 * the stop time. */
NONNULL double instance_horizon(const struct instance_state *state, struct clock_time restart,
                                double target, bool inputs_move);

/* Prepares the integrator to advance to the time end: replays its history, restarts it, or does
 * nothing, as the continuation says. */
MUST_CHECK NONNULL enum status instance_prepare_history(struct instance *instance,
                                                        struct clock_time end,
                                                        enum continuation continuation);

/* Lets the time pass to `until`, or to an earlier event of an input, in modes in which no state
 * moves, and ends the history. end: the end of the step; meets_time_event: at `until`. */
MUST_CHECK NONNULL enum status instance_rest(struct instance *instance, struct clock_time end,
                                             struct clock_time until, bool meets_time_event,
                                             enum continuation continuation);

/* Notes where a part of a step has ended, and whether the next part can continue from there.
 * is_whole: the part went to the end that it was begun with; others cannot be replayed. */
NONNULL void instance_note_part(struct instance *instance, enum status status, bool is_whole);

/* Repeats the internal steps since the restart, so that the integrator is where state says. A
 * restored instance does so at its next step, if that continues from there. */
MUST_CHECK NONNULL enum status instance_replay_history(struct instance *instance);

/* Lets searches for solutions of equations at the present point begin where the integrator's do. */
NONNULL void instance_take_anchors(struct instance *instance);

/* Writes the variables that show totals of the integrator. */
NONNULL void instance_write_statistics(const struct integrator_statistics *statistics,
                                       struct instance_values *own);

/* Brings state.next_step up to date, which costs too much to be done after each step. */
NONNULL void instance_update_next_step(struct instance *instance);

/* ---- The initial value problem -------------------------------------------------------------- */

/* Evaluate the initial value problem. context: the instance. t: s since the restart. */
ode_rhs instance_rhs;
ode_jacobian instance_jacobian;
ode_series instance_series;
ode_indicators instance_indicators;
ode_rounding instance_rounding;
ode_reach instance_reach;
ode_settle instance_settle;
