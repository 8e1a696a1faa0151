/* Modes of the model and the events at which they change. */
#ifndef INSTANCE_MODEL_MODES_H
#define INSTANCE_MODEL_MODES_H

#include "internals.h"

/* There can be state events with the parameters that the integrator runs with. Inline, as it is
 * part of each step of models without events too. */
static inline bool instance_is_searched(const struct instance *instance) {
    const struct model_events *events = instance->model->events;
    return events != NULL && events->are_possible != NULL &&
           events->are_possible(instance->memory.restart_values);
}

/* Time of the next time event, s; INFINITY: there is none. */
NONNULL double instance_next_time(const struct instance *instance);

/* No state moves in the present modes. */
NONNULL bool instance_is_at_rest(const struct instance *instance);

/* Of a state, in its unit. */
NONNULL double instance_nominal(const struct instance *instance, size_t state);

/* Writes how far each state may be from its limit where an integrator outside stops, in its unit.
 */
NONNULL void instance_write_location_errors(const struct instance *instance, double errors[]);

/* Updates modes, states and discrete states after a change of inputs and parameters and, where
 * `triggered` is not NULL, after the event at the current time. */
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_update_modes(struct instance *instance, const bool *triggered);

/* The indicators of the present modes, for the integrator; NULL: no events can be. */
MUST_CHECK NONNULL const struct indicator *instance_describe_indicators(struct instance *instance);

/* Events in one communication step so far. */
struct event_counts {
    int of_states; /* at most max_events */
    int of_time;   /* at most max_internal_steps: each ends a part of the step */
};

/* Counts an event at the current time. Fails, and says so, at the first one above its limit. */
MUST_CHECK NONNULL enum status instance_count_event(struct instance *instance,
                                                    const bool triggered[],
                                                    struct event_counts *in_step);

#endif
