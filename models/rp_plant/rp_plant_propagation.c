#include "arithmetic_taylor.h"
#include "calculated.h"
#include "rp_plant_calculated_lifted.h"

DEFINE_PROPAGATE(rp_plant_propagate, rp_plant_values)
