/* Values of an instance by value reference. */
#ifndef INSTANCE_VALUES_H
#define INSTANCE_VALUES_H

#include "instance_types.h"

#include <stdbool.h>
#include <stdint.h>

/* count values by reference; the arrays may be NULL where count is 0. Real functions take variables
 * of type float64 only, Int32 functions those of type int32, Enumeration functions enumerations,
 * Integer functions both of these, Boolean and bool functions those of type boolean, as 0 or 1. A
 * set value shows at once in what is calculated from it. */
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_set_real(struct instance *instance, const unsigned references[], size_t count,
                      const double values[]);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_set_integer(struct instance *instance, const unsigned references[], size_t count,
                         const int values[]);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_set_int32(struct instance *instance, const unsigned references[], size_t count,
                       const int values[]);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_set_enumeration(struct instance *instance, const unsigned references[], size_t count,
                             const int64_t values[]);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_set_boolean(struct instance *instance, const unsigned references[], size_t count,
                         const int values[]);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_set_bool(struct instance *instance, const unsigned references[], size_t count,
                      const bool values[]);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_real(struct instance *instance, const unsigned references[], size_t count,
                      double values[]);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_integer(struct instance *instance, const unsigned references[], size_t count,
                         int values[]);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_int32(struct instance *instance, const unsigned references[], size_t count,
                       int values[]);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_enumeration(struct instance *instance, const unsigned references[], size_t count,
                             int64_t values[]);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_boolean(struct instance *instance, const unsigned references[], size_t count,
                         int values[]);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_bool(struct instance *instance, const unsigned references[], size_t count,
                      bool values[]);

#endif
