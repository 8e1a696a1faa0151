/* Refuses a state read from bytes that no instance can be in: a hash that fits does not prove it.
 */
#pragma once

#include "state.h"

/* Returns STATUS_OK if all values of state and block (like instance_memory.block) are possible;
 * otherwise STATUS_INVALID_ARGUMENT, with a message that names the value. */
MUST_CHECK NONNULL enum status instance_check_plausible(const struct instance *instance,
                                                        const struct instance_state *state,
                                                        const char *block);
