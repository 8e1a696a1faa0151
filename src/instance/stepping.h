/* Steps from one communication point to the next. */
#pragma once

#include "snapshot.h"

/* Way in which a step deals with an event. An event at its beginning is always handled, so that
 * every step makes progress. */
enum event_handling {
    EVENTS_PASSED, /* the step handles the event and continues */
    EVENTS_END,    /* the step handles the event and ends there */
    EVENTS_LEFT,   /* the step ends there and leaves the event unhandled:
                      instance_update_discrete_states or the next step handles it */
};

/* Options of a step; each may be NULL. The functions may read values of the instance and return
 * STATUS_OK, or a status that ends the step, which returns it. */
struct step_options {
    /* Snapshot of the instance, which the step overwrites: a step that fails (severity discard)
     * leaves the instance as it was before. */
    struct instance_snapshot *undo;

    /* Sets inputs by instance_set_real, called before anything else at POLYNOMIAL_NODES times (s)
     * from the beginning to the end of the step: over the step they are the polynomials through
     * these values, of order 4. */
    enum status (*ask_inputs)(void *context, double time);

    /* Receives the time (s) at the end of each internal step that ends within the step, and at the
     * end; the instance has the values of that time. *end (s): end of the step, which may be
     * brought forward. */
    enum status (*accept)(void *context, double time, double *end);

    void *context; /* of these functions */

    enum event_handling at_event;
};

/* Steps from communication_point to communication_point + step_size (s) with constant inputs
 * (zero-order hold), or polynomials if derivatives were set. options: NULL for none. Returns
 * STATUS_INVALID_TIME if step_size is not > 0, communication_point is not where the instance is
 * (clock_slack), or the end is past the stop time. If the integration ends early (severity
 * discard), instance_time is the time it reached, with the states at that time. STATUS_ENDED: an
 * event has ended the simulation there; further steps do nothing and return it, too. */
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_do_step(struct instance *instance, double communication_point, double step_size,
                     const struct step_options *options);

/* True if the last step passed an event, or left it. */
NONNULL bool instance_met_event(const struct instance *instance);

/* True if an event has ended the simulation. */
NONNULL bool instance_has_ended(const struct instance *instance);
