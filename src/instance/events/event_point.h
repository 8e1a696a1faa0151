/* The event at which a step has ended: whether it is still due, and how the motion goes on from
 * there as if the step had not ended. */
#ifndef INSTANCE_EVENT_POINT_H
#define INSTANCE_EVENT_POINT_H

#include "internals.h"
#include "model_modes.h"

/* A step that would have lasted until `end` ends at the present time, where these indicators fall
 * to 0: nothing has followed from it so far. */
NONNULL void instance_leave_event(struct instance *instance, const bool triggered[],
                                  struct clock_time end);

/* The same where the event has been passed already. */
NONNULL void instance_note_event(struct instance *instance, struct clock_time end);

/* Brings modes, states and discrete states to what follows the event that is due, if one is. It
 * counts as one of a communication step. */
MUST_CHECK NONNULL enum status instance_pass_due_event(struct instance *instance,
                                                       struct event_counts *in_step);

/* Nothing has changed since the end of the last step, and no input moved over that step: the modes
 * already follow from the values set now. */
NONNULL bool instance_is_unchanged(const struct instance *instance);

/* The end of a step after an event: that of the step which the event cut short, if the importer
 * means the same time. Its own differences of times have rounding errors. */
NONNULL struct clock_time instance_resumed_end(const struct instance *instance,
                                               struct clock_time end);

#endif
