/* Whether an instance can be in a state that was read from bytes: a hash that fits does not prove
 * it.
 */
#ifndef PLAUSIBILITY_H
#define PLAUSIBILITY_H

#include "state.h"

/* state and block (as instance_memory.block) as read. STATUS_INVALID_ARGUMENT, with a message that
 * names the value, if one of them is impossible. */
MUST_CHECK NONNULL enum status instance_check_plausible(const struct instance *instance,
                                                        const struct instance_state *state,
                                                        const char *block);

#endif
