#pragma once

#include "bead.h"
#include "model.h"

extern const struct model_events bead_events;
const struct bead_values *bead_in_effect(const struct bead_values *values, const double x[],
                                         const double u[], struct bead_values *copy);
bool bead_check(const struct bead_values *values, char *text, size_t size);
extern const struct model bead_model;
