/* The initial value problem of an instance, as the integrator calls it: the model with the
 * parameters of the last restart, and the inputs as polynomials since then. */
#ifndef INSTANCE_RIGHT_HAND_SIDE_H
#define INSTANCE_RIGHT_HAND_SIDE_H

#include "internals.h"

/* After a restart: constant inputs are evaluated once, not at every call; moves: not all are. */
NONNULL void instance_prepare_inputs(struct instance *instance, bool moves);

/* context: the instance. t: s since the restart. */
ode_rhs instance_rhs;
ode_jacobian instance_jacobian;
ode_series instance_series;
ode_indicators instance_indicators;
ode_rounding instance_rounding;
ode_reach instance_reach;

#endif
