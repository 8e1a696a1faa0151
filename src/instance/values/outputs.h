/* The calculated values of an instance. */
#ifndef INSTANCE_OUTPUTS_H
#define INSTANCE_OUTPUTS_H

#include "internals.h"

/* Brings the calculated values up to date; a message says why that fails. */
MUST_CHECK NONNULL enum status instance_update_outputs(struct instance *instance);

#endif
