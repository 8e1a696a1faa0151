/* Where an indicator falls to 0 within a step over which it is a polynomial. */
#ifndef FALLS_H
#define FALLS_H

#include "roots.h"

struct fall {
    double error;    /* of p */
    double touch;    /* no fall leads less far below 0 before the indicator rises again */
    double latest;   /* s: falls behind it need not be located */
    bool is_restart; /* p begins at a restart */
    bool *is_armed;  /* the indicator has been above 0 since the restart; set where it rises */
    double *noise;   /* how far from 0 it may be without having risen; grows where it is farther
                        below 0 at the restart */
};

/* The first s in (0, 1] at which an indicator falls to 0; INFINITY: it does not, or it does behind
 * `latest`.
 *
 * p represents it over the step, up to an error. A fall counts only once the indicator is armed:
 * rounding may leave it on either side at a restart. */
MUST_CHECK NONNULL double fall_first(const struct roots_polynomial *p, const struct fall *fall);

#endif
