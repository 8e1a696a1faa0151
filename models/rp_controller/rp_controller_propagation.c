#include "arithmetic_taylor.h"
#include "calculated.h"
#include "rp_controller_calculated_lifted.h"

DEFINE_PROPAGATE(rp_controller_propagate, rp_controller_values)
