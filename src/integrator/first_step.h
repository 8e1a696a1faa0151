/* Lengths of the first internal step of a multistep method, which is of order 1: a fraction of that
 * at which its error would be the tolerance. s; 0: unknown. */
#ifndef FIRST_STEP_H
#define FIRST_STEP_H

#include "problem.h"

/* From the state x with the second derivative ddx. */
NONNULL double first_step_after_restart(const struct problem *problem, const double x[],
                                        const double ddx[]);

/* From the state x at the time 0, at an event. Writes x'' to ddx; uses the room of
 * problem->location. */
NONNULL double first_step_after_event(struct problem *problem, const double x[], double ddx[]);

#endif
