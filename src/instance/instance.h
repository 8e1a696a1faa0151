/* An instance of a model: its life from creation to the end of initialization. Knows no particular
 * model and no FMI. Values are in values.h, steps in stepping.h, derivatives in derivatives.h,
 * integration from outside in continuous_states.h, snapshots in snapshot.h and serialization.h.
 *
 * Every function that can fail reports its status to the sink given at creation, with one line of
 * text that says what was wrong and what was expected. Functions that set or get values are all or
 * nothing. An instance serves one thread at a time; instances share nothing. */
#pragma once

#include "variables.h"

/* Creates an instance and allocates all its memory; steps allocate nothing. description must
 * outlive the instance, sink is copied. On failure *instance is NULL. */
MUST_CHECK NONNULL enum status instance_create(const struct model_description *description,
                                               const struct message_sink *sink,
                                               struct instance **instance);

/* Frees the instance; it may be NULL. */
void instance_destroy(struct instance *instance);

/* Resets to the state right after instance_create: start values, no experiment. */
NONNULL void instance_reset(struct instance *instance);

/* Sets the experiment before initialization; may be repeated. */
MUST_CHECK NONNULL enum status
instance_setup_experiment(struct instance *instance, const struct instance_experiment *experiment);

MUST_CHECK NONNULL enum status instance_enter_initialization(struct instance *instance);

/* Ends initialization. Inconsistent parameters are refused. */
MUST_CHECK NONNULL enum status instance_exit_initialization(struct instance *instance);

/* Leaves the integration to the outside (Model Exchange): no integrator is set up, so that none is
 * refused. */
NONNULL void instance_integrate_outside(struct instance *instance);

/* Allows setting states in event mode, too, from now on; while the time is continuous they may be
 * set anyway. */
NONNULL void instance_allow_setting_states(struct instance *instance);

/* Returns the time that the instance has reached, s. */
NONNULL double instance_time(const struct instance *instance);
