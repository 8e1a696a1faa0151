/* Where an indicator falls to 0 within a step over which it is a polynomial. */
#ifndef FALLS_H
#define FALLS_H

#include "roots.h"

/* The first s in (0, 1] at which an indicator falls to 0; INFINITY: it does not, or it does behind
 * `latest`, which is then not always located.
 *
 * p represents it over the step, up to an error. A fall counts only once the indicator is armed,
 * that is, has been above 0 since the restart: rounding may leave it on either side at a restart.
 * is_armed is set where it rises. noise: how far from 0 it may still be one that has not risen; it
 * grows where the indicator is farther below 0 at the restart. */
MUST_CHECK NONNULL double fall_first(const struct roots_polynomial *p, double error, double latest,
                                     bool is_restart, bool *is_armed, double *noise);

#endif
