#include "arithmetic_taylor.h"
#include "calculated.h"
#include "rp_controller_calculated.h"

DEFINE_PROPAGATE(rp_controller_propagate, rp_controller_values)
