/* Where the values of an instance lie, and when the calculated ones are up to date. */
#ifndef INSTANCE_FIELDS_H
#define INSTANCE_FIELDS_H

#include "internals.h"

/* The variable with this reference and type; NULL, with a message, if there is none. */
NONNULL const struct variable *instance_find(const struct instance *instance, unsigned reference,
                                             enum variable_type type);

/* The place of a variable's value. */
NONNULL void *instance_field(struct instance *instance, const struct variable *variable);

/* Index of an input variable among the inputs. */
NONNULL size_t instance_input_index(const struct instance *instance,
                                    const struct variable *variable);

/* Writes the value; an input is held at it from now on. */
NONNULL void instance_write_field(struct instance *instance, const struct variable *variable,
                                  double value);

NONNULL void instance_set_clock(struct instance *instance, struct clock_time time);

/* Brings the calculated values up to date; a message says why that fails. */
MUST_CHECK NONNULL enum status instance_update_outputs(struct instance *instance);

/* Returns STATUS_NOT_FINITE, with a message that `what` cannot be computed. */
NONNULL enum status instance_not_finite(const struct instance *instance, const char *what);

#endif
