/* Derivatives of everything that the wall gives, along a curve of its parameters and inputs:
 * directional derivatives, and derivatives by time. */
#ifndef RP_ENVIRONMENT_PROPAGATION_H
#define RP_ENVIRONMENT_PROPAGATION_H

#include "rp_environment_model.h"

/* values: the parameters and inputs at a point of the curve. first, second: the first and second
 * derivatives of these along the curve, in the same fields; the derivatives of all calculated
 * fields are written. second may be NULL where the first derivatives are enough.
 *
 * Exact but for rounding. Where the force sets in or ends, these are the derivatives on the side
 * without force, all 0. The calculated fields of values are not read. */
void rp_environment_propagate(const struct rp_environment_values *values,
                              struct rp_environment_values *first,
                              struct rp_environment_values *second);

#endif
