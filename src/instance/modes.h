/* Modes of the model and every event that changes them: within a step, at its end, and at points
 * where an integrator outside stops. */
#pragma once

#include "state.h"

/* Updates modes, states and discrete states after a change of inputs and parameters and, unless
 * `triggered` is NULL, after the event at the current time. */
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_update_modes(struct instance *instance, const bool *triggered);

/* Fails, with a message, if a condition of an event has no value at the current time. */
MUST_CHECK NONNULL enum status instance_check_conditions(struct instance *instance);

/* Numbers of events in one communication step so far. */
struct event_counts {
    int of_states; /* at most max_events */
    int of_time;   /* at most max_internal_steps: each ends a part of the step */
    size_t last;   /* indicator of the last state event */
    int in_a_row;  /* state events of this indicator up to the last one */
};

/* Counts an event at the current time. Fails, with a message, at the first event above its limit.
 */
MUST_CHECK NONNULL enum status instance_count_event(struct instance *instance,
                                                    const bool triggered[],
                                                    struct event_counts *in_step);

/* ---- The event at which a step has ended ---------------------------------------------------- */

/* Updates modes, states and discrete states after the unhandled event, if there is one. It counts
 * as an event of this communication step. */
MUST_CHECK NONNULL enum status instance_handle_event(struct instance *instance,
                                                     struct event_counts *in_step);

/* True if nothing has changed since the end of the last step, and no input moved over that step:
 * the modes already follow from the values that are set now. */
NONNULL bool instance_is_unchanged(const struct instance *instance);

/* ---- Events for an integrator outside ------------------------------------------------------- */

/* Notes how large the inputs are now: importers round them by as much as their terms. */
NONNULL void instance_note_inputs(struct instance *instance);

/* Adds a small distance to the calculated indicators, so that none is 0 where a mode begins. */
NONNULL void instance_add_bands(struct instance *instance);

/* Notes, at a point where the integrator outside has stopped for an event, which indicators are at
 * 0 and do not rise, with the inputs that led there. Inputs that are set later, before the update,
 * cause no event. */
NONNULL void instance_note_unhandled(struct instance *instance);

/* True if, at the end of a step outside, an event of a generated model has come that the integrator
 * cannot see because the indicator began and ended below 0. */
MUST_CHECK NONNULL bool instance_has_missed_event(struct instance *instance);

NONNULL void instance_forget_unhandled(struct instance *instance);

/* Updates the modes for the noted event or a time event at the present time, like
 * instance_update_modes. *states_changed: whether states have jumped. */
MUST_CHECK NONNULL enum status instance_update_at_point(struct instance *instance,
                                                        bool *states_changed);
