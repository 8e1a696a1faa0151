/* Derivatives of an instance's values with respect to time and to other variables. Discrete values,
 * which are constant between events, have the derivative 0. */
#pragma once

#include "variables.h"

/* Sets derivatives of inputs with respect to time, of orders 1 to 3, at the beginning of the next
 * step: over it the inputs are Taylor polynomials. They apply to that step only. All or nothing. */
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_set_input_derivatives(struct instance *instance, const unsigned references[],
                                   size_t count, const int orders[], const double values[]);

/* Reads derivatives of Real outputs with respect to time, of orders 1 and 2, at the current time,
 * with the polynomials of the inputs that apply there. All or nothing. */
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_output_derivatives(struct instance *instance, const unsigned references[],
                                    size_t count, const int orders[], double values[]);

/* Kinds of variables with respect to which derivatives are taken. */
enum known_kinds {
    KNOWN_MOTION,    /* inputs, states and, before the first step, parameters */
    KNOWN_ARGUMENTS, /* inputs, states, parameters and the time */
};

/* Writes J v. J: derivatives of unknowns (Real variables of the model that are not parameters or
 * inputs, and discrete ones of the instance) with respect to knowns of these kinds. */
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_directional_derivative(struct instance *instance, enum known_kinds kinds,
                                        const unsigned unknowns[], size_t unknown_count,
                                        const unsigned knowns[], size_t known_count,
                                        const double v[], double result[]);

/* Writes v^T J, one value per known, for the same unknowns and knowns; v has one value per unknown.
 */
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_adjoint_derivative(struct instance *instance, enum known_kinds kinds,
                                    const unsigned unknowns[], size_t unknown_count,
                                    const unsigned knowns[], size_t known_count, const double v[],
                                    double result[]);
