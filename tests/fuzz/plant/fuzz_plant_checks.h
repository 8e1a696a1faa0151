/* What holds for the values of RPPlant. A violation is a finding. */
#ifndef FUZZ_PLANT_CHECKS_H
#define FUZZ_PLANT_CHECKS_H

#include "fuzz_instance.h"
#include "value_references.h"

/* After a step that succeeded: joints are within their stops, held ones stand still, friction and
 * stops are no stronger than they can be and do not drive. */
void fuzz_check_point(const struct fuzz_values *values);

/* Only within their stops: that holds after a discarded step, too. */
void fuzz_check_stops(const struct fuzz_values *values);

/* Over a step with held inputs and without a wrench: friction, damping, impacts and grasps take
 * energy, and give none, up to what the tolerance (as requested) allows. Sums over events grow. */
void fuzz_check_losses(const struct fuzz_values *before, const struct fuzz_values *after,
                       double tolerance);

/* The text of a step with too many events names an indicator, and a time between these (s). */
void fuzz_check_event_text(const char *text, double earliest, double latest);

#endif
