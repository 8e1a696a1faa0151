/* Events for an integrator outside (Model Exchange), which finds them by the indicators among the
 * outputs. */
#ifndef INSTANCE_OUTSIDE_EVENTS_H
#define INSTANCE_OUTSIDE_EVENTS_H

#include "internals.h"

/* For an integrator outside: adds to the calculated indicators what keeps them from being 0 where a
 * mode begins. */
NONNULL void instance_add_bands(struct instance *instance);

/* At a point that an integrator outside takes for an event: notes which indicators are at 0 and do
 * not rise, with the inputs that led there. What is set before the update is no event. */
NONNULL void instance_note_due(struct instance *instance);

NONNULL void instance_forget_due(struct instance *instance);

/* As instance_update_modes, with what instance_note_due has noted and a time event that has come.
 * *states_changed: whether states have jumped. */
MUST_CHECK NONNULL enum status instance_update_at_point(struct instance *instance,
                                                        bool *states_changed);

#endif
