/* The Taylor series of the plant's motion in its modes. */
#ifndef RP_PLANT_SERIES_H
#define RP_PLANT_SERIES_H

#include "model.h"

/* Of struct rp_plant_values: states q1, q2, q1', q2', inputs tau1, f2 and the wrench. */
extern const struct series rp_plant_series;

/* reach of struct model_events, for struct rp_plant_values. */
void rp_plant_reach(const void *values, const double x[], double reach[]);

#endif
