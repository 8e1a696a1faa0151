/* Derivatives of everything that the arm calculates, along a curve of its parameters, inputs and
 * states: directional derivatives, and derivatives by time along the motion. */
#ifndef RP_PROPAGATION_H
#define RP_PROPAGATION_H

#include "rp_model.h"

/* values: the parameters, inputs and states at a point of the curve, valid as in rp_manipulator.h.
 * first, second: the first and second derivatives of these along the curve, in the same fields; the
 * derivatives of all calculated fields are written. second may be NULL where the first derivatives
 * are enough; these do not depend on it.
 *
 * Exact but for rounding, and exactly zero for a field whose arguments do not move. The
 * calculated fields of values are not read. */
void rp_propagate(const struct rp_values *values, struct rp_values *first,
                  struct rp_values *second);

#endif
