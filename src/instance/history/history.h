/* The integrator's history of internal steps: when it may go on from it, and how a restored
 * instance gets it back. */
#ifndef INSTANCE_HISTORY_H
#define INSTANCE_HISTORY_H

#include "internals.h"

/* How the integrator gets to a time: it goes on from its history, gets that back first, after a
 * restore, restarts on the same motion, because the history has become too long, restarts because
 * an input or a parameter has changed, or restarts after an event, wherever it ends next. */
enum continuation {
    CONTINUE_NOW,
    CONTINUE_AFTER_REPLAY,
    CONTINUE_AFTER_RESTART,
    CONTINUE_AFTER_CHANGE,
    CONTINUE_AFTER_EVENT,
};

/* target: s since the restart. */
MUST_CHECK NONNULL enum continuation instance_continuation(const struct instance *instance,
                                                           double target);

/* integrator_longest_history of the method, in the present modes. */
NONNULL int64_t instance_longest_history(const struct instance *instance);

/* What is set now holds from the present time on, the inputs being these polynomials of time, up to
 * the time end at least: the history is over. */
NONNULL void instance_hold(struct instance *instance, struct clock_time end,
                           const struct polynomial inputs[]);

/* How far from a restart the integrator may go, s: to target where inputs move, otherwise to the
 * stop time. */
NONNULL double instance_horizon(const struct instance_state *state, struct clock_time restart,
                                double target, bool inputs_move);

/* The history is over; times since the restart count from the present time on. */
NONNULL void instance_end_history(struct instance *instance);

/* Prepares the integrator for an advance to the time end by this continuation. */
MUST_CHECK NONNULL enum status instance_prepare_history(struct instance *instance,
                                                        struct clock_time end,
                                                        enum continuation continuation);

/* Brings the integrator back to where state says, with what it has kept of its internal steps: a
 * restored instance does so at its next step, if that goes on from there. */
MUST_CHECK NONNULL enum status instance_replay_history(struct instance *instance);

/* Brings state.next_step up to date, which costs too much to be done after each step. */
NONNULL void instance_update_next_step(struct instance *instance);

#endif
