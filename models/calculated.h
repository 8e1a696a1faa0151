/* propagate of struct model, made from one equation: `calculate` (equation.h) writes all calculated
 * fields of a value structure from its parameters, inputs and states:
 *
 *   EQUATION void calculate(const struct my_values *const from[SOURCES],
 *                           struct my_values *const to[TARGETS]) */
#ifndef CALCULATED_H
#define CALCULATED_H

#include "status.h"

#include <stddef.h>

/* Defines `propagate` by this name, in a file with arithmetic_taylor.h, for a model without fields
 * that depend on the time itself. Its results are exact but for rounding, and 0 for a field whose
 * arguments do not move; the calculated fields of values are not read. Where the second derivatives
 * are not asked for, the compiler leaves them out. */
#define DEFINE_PROPAGATE(name, tag)                                                                \
    enum status name(const void *values, double t, double dt, void *first, void *second) {         \
        if (second != NULL) {                                                                      \
            const struct tag *const from[SOURCES] = {values, first, second};                       \
            struct tag *const to[TARGETS] = {first, second};                                       \
            calculate(from, to);                                                                   \
        } else {                                                                                   \
            struct tag straight = {0};                                                             \
            const struct tag *const from[SOURCES] = {values, first, &straight};                    \
            struct tag *const to[TARGETS] = {first, &straight};                                    \
            calculate(from, to);                                                                   \
        }                                                                                          \
        return STATUS_OK;                                                                          \
    }

#endif
