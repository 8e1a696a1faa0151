/* The sampled form of the controller: samples and changes of the efforts are events in time. */
#pragma once

#include "rp_controller_model.h"

extern const struct model_events rp_controller_events;

/* s: the shortest sample_time above 0. */
extern const double rp_controller_shortest_sample_time;
