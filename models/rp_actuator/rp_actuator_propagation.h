/* Derivatives of everything that the drives calculate, along a curve of their parameters, inputs
 * and states: directional derivatives, and derivatives by time. */
#ifndef RP_ACTUATOR_PROPAGATION_H
#define RP_ACTUATOR_PROPAGATION_H

#include "rp_actuator_model.h"

/* values: the parameters, inputs and states at a point of the curve. first, second: the first and
 * second derivatives of these along the curve, in the same fields; the derivatives of all
 * calculated fields are written. second may be NULL where the first derivatives are enough.
 *
 * Exact but for rounding. A current is taken as free strictly within its limits; at and beyond one
 * it moves as this limit does. The calculated fields of values are not read. */
void rp_actuator_propagate(const struct rp_actuator_values *values,
                           struct rp_actuator_values *first, struct rp_actuator_values *second);

#endif
