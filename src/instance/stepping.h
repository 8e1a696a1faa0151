/* Steps from one communication point to the next. */
#ifndef INSTANCE_STEPPING_H
#define INSTANCE_STEPPING_H

#include "instance.h"

/* Steps from communication_point to communication_point + step (s) with the inputs held, or as
 * polynomials where derivatives were set.
 * STATUS_INVALID_TIME: step not > 0, communication_point not where the instance is (clock_slack),
 * or the end past the stop time. If the integration ends early (severity discard), instance_time is
 * the time it reached, and the states are those of that time. */
MUST_CHECK NONNULL enum status instance_do_step(struct instance *instance,
                                                double communication_point, double step);

#endif
