#pragma once

#include "bead_values.h"

enum { UNDECIDED, FLIES, RESTS };

static inline void bead_calculate(struct bead_values *values) {
    const int rests = values->mode == RESTS;
    values->a = rests ? 0.0 : -values->parameters.g;
    values->way = rests ? 1.0 : values->motion[0];
}
