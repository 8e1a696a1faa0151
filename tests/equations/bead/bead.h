#pragma once

#include "bead_values.h"

enum { UNDECIDED, FLIES, RESTS };

static inline void bead_calculate(struct bead_values *values) {
    const int rests = values->mode == RESTS;
    const double pull = values->parameters.g - values->lift;
    values->a = rests ? 0.0 : -pull;
    values->way = rests ? 1.0 : values->motion[0];
    values->load = rests ? pull : 1.0;
}
