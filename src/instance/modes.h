/* Modes of the model and every event that changes them: within a step, at its end, and where an
 * integrator outside stops. */
#ifndef MODES_H
#define MODES_H

#include "state.h"

/* Updates modes, states and discrete states after a change of inputs and parameters and, where
 * `triggered` is not NULL, after the event at the current time. */
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_update_modes(struct instance *instance, const bool *triggered);

/* Events in one communication step so far. */
struct event_counts {
    int of_states; /* at most max_events */
    int of_time;   /* at most max_internal_steps: each ends a part of the step */
};

/* Counts an event at the current time. Fails, and says so, at the first one above its limit. */
MUST_CHECK NONNULL enum status instance_count_event(struct instance *instance,
                                                    const bool triggered[],
                                                    struct event_counts *in_step);

/* ---- The event at which a step has ended ----------------------------------------------------
 * Whether it is handled, and how the motion continues from there as if the step had not ended. */

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

/* ---- Events for an integrator outside ------------------------------------------------------- */

/* Adds a small distance to the calculated indicators, so that none is 0 where a mode begins. */
NONNULL void instance_add_bands(struct instance *instance);

/* At a point where the integrator outside has stopped for an event: notes as unhandled which
 * indicators are at 0 and do not rise, with the inputs that led there. Inputs that are set later,
 * before the update, cause no event. */
NONNULL void instance_note_unhandled(struct instance *instance);

/* At the end of a step outside: an event of a generated model has come, which the integrator cannot
 * see where the step began and ends below 0. */
MUST_CHECK NONNULL bool instance_has_missed_event(struct instance *instance);

NONNULL void instance_forget_unhandled(struct instance *instance);

/* As instance_update_modes, for the noted event or a time event at the present time.
 * *states_changed: whether states have jumped. */
MUST_CHECK NONNULL enum status instance_update_at_point(struct instance *instance,
                                                        bool *states_changed);

#endif
