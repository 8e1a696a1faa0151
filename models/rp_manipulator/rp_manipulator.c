#include "rp_manipulator.h"

#include "rp_equations.h"

#include <stdio.h>

static bool is_valid(const struct rp_parameters *p) {
    const double not_negative[] = {p->m1, p->I1z, p->I2z, p->l1, p->lc1};
    for (size_t i = 0; i < sizeof not_negative / sizeof not_negative[0]; i++) {
        if (!isfinite(not_negative[i]) || not_negative[i] < 0.0) {
            return false;
        }
    }
    return isfinite(p->m2) && p->m2 > 0.0 && isfinite(p->a) && isfinite(p->g) &&
           arm_fixed_inertia(p) > 0.0;
}

bool rp_parameters_check(const struct rp_parameters *p, char *text, size_t size) {
    if (is_valid(p)) {
        return true;
    }
    (void)snprintf(text, size,
                   "the inertia m1 lc1^2 + I1z + I2z = %g is refused: it must be above 0 "
                   "(m1 = %g, lc1 = %g, I1z = %g, I2z = %g)",
                   arm_fixed_inertia(p), p->m1, p->lc1, p->I1z, p->I2z);
    return false;
}
