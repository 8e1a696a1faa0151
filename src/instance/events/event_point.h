/* The event at which a step has ended: whether it is handled, and how the motion continues from
 * there as if the step had not ended. */
#ifndef INSTANCE_EVENT_POINT_H
#define INSTANCE_EVENT_POINT_H

#include "internals.h"
#include "model_modes.h"

/* A step that would have lasted until `end` ends at the present time, where these indicators fall
 * to 0. The event stays unhandled. */
NONNULL void instance_leave_event(struct instance *instance, const bool triggered[],
                                  struct clock_time end);

/* The same for an event that has been handled. */
NONNULL void instance_note_handled_event(struct instance *instance, struct clock_time end);

/* Updates modes, states and discrete states after the unhandled event, if there is one. It counts
 * as an event of this communication step. */
MUST_CHECK NONNULL enum status instance_handle_event(struct instance *instance,
                                                     struct event_counts *in_step);

/* Nothing has changed since the end of the last step, and no input moved over that step: the modes
 * already follow from the values set now. */
NONNULL bool instance_is_unchanged(const struct instance *instance);

/* The end of a step after an event: that of the step which the event cut short, if the importer
 * means the same time. Its own differences of times have rounding errors. */
NONNULL struct clock_time instance_resumed_end(const struct instance *instance,
                                               struct clock_time end);

#endif
