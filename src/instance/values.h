/* Values of an instance by value reference, and its calculated values. */
#pragma once

#include "variables.h"

#include <stdbool.h>
#include <stdint.h>

/* Types of values, listed once for all functions that exist for each type.
 *
 * X(name in functions, name in constants, element of an array) for the types that are kept as int:
 *   integer       variables of type int32 and enumerations
 *   int32         variables of type int32
 *   enumeration   enumerations
 *   boolean       Booleans, as 0 or 1
 *   bool          Booleans */
#define INTEGER_TYPE_LIST(X)                                                                       \
    X(integer, INTEGER, int)                                                                       \
    X(int32, INT32, int)                                                                           \
    X(enumeration, ENUMERATION, int64_t)                                                           \
    X(boolean, BOOLEAN, int)                                                                       \
    X(bool, BOOL, bool)

/* X for the same types and for real: variables of type float64. */
#define VALUE_TYPE_LIST(X) X(real, REAL, double) INTEGER_TYPE_LIST(X)

/* For each type of value, such as instance_set_real and instance_get_real: set or read count
 * values. The arrays may be NULL if count is 0. A variable of another type is refused. A set value
 * shows at once in all values that are calculated from it. */
#define INSTANCE_ACCESS(name, constant, element)                                                   \
    MUST_CHECK NONNULL_ARGUMENTS(1) enum status instance_set_##name(                               \
        struct instance *instance, const unsigned references[], size_t count,                      \
        const element values[]);                                                                   \
    MUST_CHECK NONNULL_ARGUMENTS(1) enum status instance_get_##name(                               \
        struct instance *instance, const unsigned references[], size_t count, element values[]);
VALUE_TYPE_LIST(INSTANCE_ACCESS)
#undef INSTANCE_ACCESS

/* Brings the calculated values up to date; if that fails, a message says why. */
MUST_CHECK NONNULL enum status instance_update_outputs(struct instance *instance);
