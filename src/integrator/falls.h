/* Where an indicator falls to 0 within a step over which it is a polynomial. */
#ifndef FALLS_H
#define FALLS_H

#include "roots.h"

/* The first s in (0, 1] at which p, which represents an indicator up to an error, falls to 0;
 * INFINITY: it does not. is_armed: the indicator has been above 0 since the restart; written where
 * it rises. noise: as long as it is not armed, it may have either sign within this; written where
 * it is farther below 0. */
MUST_CHECK NONNULL double fall_first(const struct roots_polynomial *p, double error, bool *is_armed,
                                     double *noise);

#endif
