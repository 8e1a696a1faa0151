/* Settings of an instance: its experiment, its parameters, and the resulting integrator settings.
 */
#ifndef SETTINGS_H
#define SETTINGS_H

#include "state.h"

/* Absolute tolerance of a state, over relative tolerance times nominal value. */
#define INSTANCE_ABSOLUTE_FRACTION 1e-2

/* STATUS_OK if the experiment can be run; otherwise a message says why not. */
MUST_CHECK NONNULL enum status
instance_check_experiment(const struct instance *instance,
                          const struct instance_experiment *experiment);

/* STATUS_OK if the parameters are consistent; otherwise a message says why not. */
MUST_CHECK NONNULL enum status instance_check_parameters(struct instance *instance);

/* STATUS_OK if the method that is set can integrate the model; otherwise a message says which can.
 */
MUST_CHECK NONNULL enum status instance_check_method(const struct instance *instance);

/* The relative tolerance that the integrator runs at, by the settings in state. */
NONNULL double instance_tolerance(const struct instance *instance,
                                  const struct instance_state *state);

/* Writes it where users read it, and the absolute tolerances. */
NONNULL void instance_update_tolerance(struct instance *instance);

/* Says so in a message if the experiment's tolerance is too coarse to be used as it is. */
NONNULL void instance_report_tolerance(const struct instance *instance);

/* The values ask for another method, tolerance or limit than the integrator has. */
NONNULL bool instance_is_configured_otherwise(const struct instance *instance);

/* Gives the integrator the method, tolerances and limits that the values ask for. */
MUST_CHECK NONNULL enum status instance_configure_integrator(struct instance *instance);

#endif
