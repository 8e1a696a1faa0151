/* The integrator's history of internal steps: when it may continue from it, how a restored instance
 * gets it back, and the initial value problem that it calls: the model with the parameters of the
 * last restart, and the inputs as polynomials since then. */
#ifndef HISTORY_H
#define HISTORY_H

#include "state.h"

/* How the integrator continues. */
enum continuation {
    CONTINUE_NOW,           /* from its history */
    CONTINUE_AFTER_REPLAY,  /* from its history, which a restored instance repeats first */
    CONTINUE_AFTER_RESTART, /* on the same motion: the history has become too long */
    CONTINUE_AFTER_CHANGE,  /* with a restart: an input or a parameter has changed */
    CONTINUE_AFTER_EVENT,   /* with a restart, in the modes after an event */
};

/* target: s since the restart. */
MUST_CHECK NONNULL enum continuation instance_continuation(const struct instance *instance,
                                                           double target);

/* integrator_longest_history of the method, in the present modes. */
NONNULL int64_t instance_longest_history(const struct instance *instance);

/* From the present time on the integrator runs with the values that are set now, and with these
 * polynomials of time as inputs, at least up to the time end. Ends the history. */
NONNULL void instance_activate_values(struct instance *instance, struct clock_time end,
                                      const struct polynomial inputs[]);

/* How far from a restart the integrator may go, s: to target where inputs move, otherwise to the
 * stop time. */
NONNULL double instance_horizon(const struct instance_state *state, struct clock_time restart,
                                double target, bool inputs_move);

/* Times since the restart count from the present time on. */
NONNULL void instance_end_history(struct instance *instance);

/* Prepares the integrator to advance to the time end: replays its history, restarts it, or does
 * nothing, as the continuation says. */
MUST_CHECK NONNULL enum status instance_prepare_history(struct instance *instance,
                                                        struct clock_time end,
                                                        enum continuation continuation);

/* Repeats the internal steps since the restart, so that the integrator is where state says. A
 * restored instance does so at its next step, if that continues from there. */
MUST_CHECK NONNULL enum status instance_replay_history(struct instance *instance);

/* Brings state.next_step up to date, which costs too much to be done after each step. */
NONNULL void instance_update_next_step(struct instance *instance);

/* ---- The initial value problem --------------------------------------------------------------- */

/* context: the instance. t: s since the restart. */
ode_rhs instance_rhs;
ode_jacobian instance_jacobian;
ode_series instance_series;
ode_indicators instance_indicators;
ode_rounding instance_rounding;
ode_reach instance_reach;

#endif
