#include "arithmetic_taylor.h"
#include "calculated.h"
#include "rp_calculated.h"

DEFINE_PROPAGATE(rp_propagate, rp_values)
