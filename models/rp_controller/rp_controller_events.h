/* The sampled form of the controller: samples and changes of the efforts are events in time. */
#ifndef RP_CONTROLLER_EVENTS_H
#define RP_CONTROLLER_EVENTS_H

#include "rp_controller_model.h"

extern const struct model_events rp_controller_events;

/* s: the shortest sample_time above 0. */
extern const double rp_controller_shortest_sample_time;

#endif
