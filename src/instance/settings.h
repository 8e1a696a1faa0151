/* Settings of an instance: its experiment, its parameters, and the integrator's settings that
 * follow. */
#pragma once

#include "state.h"

/* Ratio of a state's absolute tolerance to the relative tolerance times the nominal value. */
#define INSTANCE_ABSOLUTE_FRACTION 1e-2

/* Returns STATUS_OK if the experiment can be run; otherwise a message says why not. */
MUST_CHECK NONNULL enum status
instance_check_experiment(const struct instance *instance,
                          const struct instance_experiment *experiment);

/* Returns STATUS_OK if the parameters are consistent; otherwise a message says why not. */
MUST_CHECK NONNULL enum status instance_check_parameters(struct instance *instance);

/* Return the requested relative tolerance, and the one of the integrator, by settings in state. */
NONNULL double instance_requested_tolerance(const struct instance *instance,
                                            const struct instance_state *state);
NONNULL double instance_tolerance(const struct instance *instance,
                                  const struct instance_state *state);

/* Writes this tolerance where users read it, and the absolute tolerances. */
NONNULL void instance_update_tolerance(struct instance *instance);

/* True if the values ask for another method, tolerance or limit than the integrator has. */
NONNULL bool instance_is_configured_otherwise(const struct instance *instance);

/* Gives the integrator the method, tolerances and limits that the values ask for. */
MUST_CHECK NONNULL enum status instance_configure_integrator(struct instance *instance);
