/* Steps from one communication point to the next. */
#ifndef STEPPING_H
#define STEPPING_H

#include "snapshot.h"

/* Steps from communication_point to communication_point + step_size (s) with constant inputs
 * (zero-order hold), or polynomials where derivatives were set. STATUS_INVALID_TIME: step_size not
 * > 0, communication_point not where the instance is (clock_slack), or the end past the stop time.
 * If the integration ends early (severity discard), instance_time is the time it reached, and the
 * states are those of that time. */
MUST_CHECK NONNULL enum status instance_do_step(struct instance *instance,
                                                double communication_point, double step_size);

/* What a step does at an event. An event at its beginning is always handled, so that every step
 * makes progress. */
enum event_handling {
    EVENTS_PASSED, /* it handles the event and continues */
    EVENTS_END,    /* it handles the event and ends there */
    EVENTS_LEFT,   /* it ends there and leaves the event unhandled:
                      instance_update_discrete_states or the next step handles it */
};

/* What a step does on its way; what is NULL is left out. The functions may read values of the
 * instance and return STATUS_OK, or a status that ends the step and is returned by it. */
struct step_options {
    /* A snapshot of the instance, which the step overwrites: a step that fails (severity discard)
     * leaves the instance as it was before. */
    struct instance_snapshot *undo;

    /* Called before anything else at POLYNOMIAL_NODES times (s) from the beginning to the end of
     * the step, to set inputs by instance_set_real: over the step they are the polynomials through
     * these values, of order 4. */
    enum status (*ask_inputs)(void *context, double time);

    /* Called at the end of each internal step that ends within the step, and at the end, with the
     * values of that time (s). *end (s): where the step will end; it may be brought forward. */
    enum status (*accept)(void *context, double time, double *end);

    void *context; /* of these functions */

    enum event_handling at_event;
};

/* As instance_do_step; instance_time says where the step has ended. */
MUST_CHECK NONNULL enum status instance_do_step_with(struct instance *instance,
                                                     double communication_point, double step_size,
                                                     const struct step_options *options);

/* The last step passed an event, or left it. */
NONNULL bool instance_met_event(const struct instance *instance);

#endif
