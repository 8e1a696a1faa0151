/* Events for an integrator outside (Model Exchange), which finds them by the indicators among the
 * outputs. */
#ifndef INSTANCE_OUTSIDE_EVENTS_H
#define INSTANCE_OUTSIDE_EVENTS_H

#include "internals.h"

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
