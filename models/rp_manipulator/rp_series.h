/* The Taylor series of the arm's motion. */
#ifndef RP_SERIES_H
#define RP_SERIES_H

#include "series.h"

/* Of struct rp_values: states q1, q2, q1', q2', inputs tau1, f2. */
extern const struct series rp_series;

#endif
