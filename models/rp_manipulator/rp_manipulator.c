#include "rp_manipulator.h"

#include "rp_equations.h"

#include <stdio.h>

bool rp_parameters_check(const struct arm_parameters *p, char *text, size_t size) {
    if (arm_fixed_inertia(p) > 0.0) {
        return true;
    }
    (void)snprintf(text, size,
                   "the inertia m1 lc1^2 + I1z + I2z = %g is refused: it must be above 0 "
                   "(m1 = %g, lc1 = %g, I1z = %g, I2z = %g)",
                   arm_fixed_inertia(p), p->m1, p->lc1, p->I1z, p->I2z);
    return false;
}
