/* Falls of an indicator to 0 within a step, given by its polynomial. A touch of 0 is no fall; near
 * a restart, rounding may leave an indicator on either side of 0. */
#pragma once

#include "platform.h"
#include "roots.h"

#include <stdbool.h>

/* The rounding of some thousand steps, of one. */
static const double falls_roundings = 0x1p7;

struct fall {
    double error; /* error of p */
    double touch; /* depth below 0 that a fall leads to at least before the indicator rises again */
    double latest;   /* s; later falls need not be located */
    bool is_restart; /* true if p begins at a restart */
    bool *is_armed;  /* true if it has been above 0 since the restart; set when it rises */
    double *noise;   /* how far from 0 the indicator may be without having risen; grows if it is
                        farther below 0 at the restart */
};

/* Returns the first s in (0, 1] at which an indicator falls to 0; INFINITY if it does not fall, or
 * falls later than `latest`.
 *
 * p represents the indicator over the step, up to an error. A fall counts only once the indicator
 * is armed: rounding may leave it on either side of 0 at a restart. */
MUST_CHECK NONNULL double fall_first(const struct roots_polynomial *p, const struct fall *fall);
