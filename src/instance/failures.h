/* Explanations of failures, for messages: which expression of the model's file is not finite, with
 * the values of its names. Nothing here runs before something has failed. */
#pragma once

#include "instance.h"

/* A line of text that grows up to its size. */
struct explanation {
    char text[440];
    size_t length;
};

/* Adds why an expression is not finite with the values set now: the values of its names. Uses
 * instance->first_derivatives. */
NONNULL void instance_explain_text(struct instance *instance, const char *text,
                                   struct explanation *explanation);

/* Writes why the integrator has failed with this status: nothing if that is not known. Uses
 * instance->first_derivatives. */
NONNULL void instance_explain_step(struct instance *instance, enum status status,
                                   struct explanation *explanation);

/* Returns STATUS_NOT_FINITE, with a message about the double or int at this offset of the values
 * shown. */
NONNULL enum status instance_field_not_finite(struct instance *instance, size_t offset);
