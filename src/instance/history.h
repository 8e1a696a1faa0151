/* The integrator's history of internal steps: when it may go on from it, and how a restored
 * instance gets it back. */
#ifndef INSTANCE_HISTORY_H
#define INSTANCE_HISTORY_H

#include "internals.h"

/* The integrator goes on to the time end from where it is, without a restart or a replay. */
MUST_CHECK NONNULL bool instance_goes_on(const struct instance *instance, struct clock_time end);

/* Prepares the integrator for an advance to the time end: it goes on from its history, gets it back
 * after a restore, or restarts because an input or a parameter has changed. */
MUST_CHECK NONNULL enum status instance_prepare_history(struct instance *instance,
                                                        struct clock_time end);

/* Brings state.next_step up to date, which costs too much to be done after each step. */
NONNULL void instance_update_next_step(struct instance *instance);

#endif
