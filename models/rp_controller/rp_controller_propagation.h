/* Derivatives of everything that the controller calculates, along a curve of its parameters, inputs
 * and states: directional derivatives, and derivatives by time. */
#ifndef RP_CONTROLLER_PROPAGATION_H
#define RP_CONTROLLER_PROPAGATION_H

#include "rp_controller_model.h"

/* values: the parameters, inputs and states at a point of the curve. first, second: the first and
 * second derivatives of these along the curve, in the same fields, except the mode; the derivatives
 * of all calculated fields are written. second may be NULL where the first derivatives are enough;
 * these do not depend on it.
 *
 * Exact but for rounding. An effort is taken as free strictly within its limits; at and beyond them
 * it is the limit, which moves only with tau1_max and f2_max. Where the effort just meets its limit
 * these are one-sided derivatives. The calculated fields of values are not read. */
void rp_controller_propagate(const struct rp_controller_values *values,
                             struct rp_controller_values *first,
                             struct rp_controller_values *second);

#endif
