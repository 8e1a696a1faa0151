#include "arithmetic_taylor.h"
#include "calculated.h"
#include "rp_actuator_calculated_lifted.h"

DEFINE_PROPAGATE(rp_actuator_propagate, rp_actuator_values)
