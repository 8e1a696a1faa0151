/* What C by hand adds to rp_plant.toml (its hook): events, and the modes that they set. */
#pragma once

#include "model.h"
#include "rp_plant.h"

enum { RP_PLANT_INDICATORS = 10 }; /* four of joint 1, four of joint 2; a fifth of each */

/* Events of the plant: a joint comes to rest, breaks away, reaches a stop; the payload is grasped
 * or released; an input or a parameter jumps (rp_plant_events.c). */
extern const struct model_events rp_plant_events;

/* Returns values with the modes in effect at states and inputs: `values` themselves, or `copy`
 * where the modes are to be corrected, or during the initialization, when none are decided. */
const struct rp_plant_values *rp_plant_in_effect(const struct rp_plant_values *values,
                                                 const double x[], const double u[],
                                                 struct rp_plant_values *copy);

/* Returns false, and why in text, where a joint starts outside of its rigid stops. */
bool rp_plant_check(const struct rp_plant_values *values, char *text, size_t size);

/* Made of rp_plant.toml. */
extern const struct model rp_plant_model;
