/* Events of the plant: a joint comes to rest, breaks away, reaches a stop; the payload is grasped
 * or released; an input or a parameter jumps. */
#ifndef RP_PLANT_EVENTS_H
#define RP_PLANT_EVENTS_H

#include "rp_plant_model.h"

extern const struct model_events rp_plant_events;

/* Whether all modes are of their enumerations. */
bool rp_plant_modes_exist(const struct rp_plant_modes *modes);

#endif
