/* Values of an instance by value reference. */
#ifndef INSTANCE_VALUES_H
#define INSTANCE_VALUES_H

#include "instance_types.h"
#include "value_types.h"

/* For each type of value, as instance_set_real and instance_get_real: set or read count values. The
 * arrays may be NULL where count is 0. A variable of another type is refused. A set value shows at
 * once in what is calculated from it. */
#define INSTANCE_ACCESS(name, constant, element)                                                   \
    MUST_CHECK NONNULL_ARGUMENTS(1) enum status instance_set_##name(                               \
        struct instance *instance, const unsigned references[], size_t count,                      \
        const element values[]);                                                                   \
    MUST_CHECK NONNULL_ARGUMENTS(1) enum status instance_get_##name(                               \
        struct instance *instance, const unsigned references[], size_t count, element values[]);
VALUE_TYPE_LIST(INSTANCE_ACCESS)
#undef INSTANCE_ACCESS

#endif
