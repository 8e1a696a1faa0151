/* The calculated values of an instance. */
#ifndef INSTANCE_OUTPUTS_H
#define INSTANCE_OUTPUTS_H

#include "internals.h"

/* Brings the calculated values up to date; a message says why that fails. */
MUST_CHECK NONNULL enum status instance_update_outputs(struct instance *instance);

/* Writes initial_values: ends the initialization for a moment, without a message. Where it cannot
 * end, they are the present values. */
NONNULL void instance_look_ahead(struct instance *instance);

/* Return the value structure from which calculated values are read once they are up to date. In
 * initialization mode it is what the end of this mode will make of the values. */
static inline char *instance_shown_values(const struct instance *instance) {
    const bool is_initializing = instance->state.phase == PHASE_INITIALIZATION;
    return is_initializing && instance->initial_values != NULL ? instance->initial_values
                                                               : instance->memory.values;
}

#endif
