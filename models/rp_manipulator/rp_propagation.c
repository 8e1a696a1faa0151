#include "arithmetic_taylor.h"
#include "calculated.h"
#include "rp_calculated_lifted.h"

DEFINE_PROPAGATE(rp_propagate, rp_values)
