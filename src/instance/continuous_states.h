/* Integration from outside (Model Exchange): continuous time, and all states at once. */
#pragma once

#include "variables.h"

/* Enters continuous time, in which only continuous inputs may be set. */
MUST_CHECK NONNULL enum status instance_enter_continuous_time(struct instance *instance);
NONNULL void instance_enter_event_mode(struct instance *instance);

/* Ends a step of the integrator outside. *has_event: true if event mode is needed. */
MUST_CHECK NONNULL enum status instance_complete_step(struct instance *instance, bool *has_event);

struct discrete_update {
    bool has_ended;      /* true if an event has ended the simulation */
    bool states_changed; /* true if states that are integrated outside have jumped */
    bool is_incomplete;  /* true with integration from outside if the next time event is not later
                            than now */
    double next_time;    /* time of the next time event, s; INFINITY if there is none */
};

/* Updates the modes in event mode, for the values set and the event at the current time. This is
 * the event that a step has left unhandled; with integration from outside, a time event, or an
 * event whose indicator is near 0 and falls. */
MUST_CHECK NONNULL enum status instance_update_discrete_states(struct instance *instance,
                                                               struct discrete_update *update);

MUST_CHECK NONNULL enum status instance_set_time(struct instance *instance, double time);

/* Access all states; count must be instance_state_count, the arrays may be NULL if it is 0. All or
 * nothing. */
NONNULL size_t instance_state_count(const struct instance *instance);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_set_states(struct instance *instance, const double x[], size_t count);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_states(struct instance *instance, double x[], size_t count);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_derivatives(struct instance *instance, double dx[], size_t count);
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_nominals(struct instance *instance, double nominals[], size_t count);

/* Reads the variables that are the event indicators; count must be their number. */
MUST_CHECK NONNULL_ARGUMENTS(1) enum status
    instance_get_indicators(struct instance *instance, double indicators[], size_t count);
