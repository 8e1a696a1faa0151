/* Values of an instance by value reference. */
#ifndef INSTANCE_VALUES_H
#define INSTANCE_VALUES_H

#include "instance.h"

/* count values by reference; the arrays may be NULL where count is 0. Real functions take Real
 * variables only, Integer functions Integer ones. A set value shows at once in what is calculated
 * from it. */
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_set_real(struct instance *instance, const unsigned references[], size_t count,
                      const double values[]);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_set_integer(struct instance *instance, const unsigned references[], size_t count,
                         const int values[]);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_real(struct instance *instance, const unsigned references[], size_t count,
                      double values[]);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_integer(struct instance *instance, const unsigned references[], size_t count,
                         int values[]);

#endif
