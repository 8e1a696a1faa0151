#include "arithmetic_taylor.h"
#include "calculated.h"
#include "rp_environment_equations.h"

DEFINE_PROPAGATE(rp_environment_propagate, rp_environment_values)
