#include "rp_controller_propagation.h"

#include "arithmetic_taylor.h"
#include "rp_controller_calculated.h"

void rp_controller_propagate(const struct rp_controller_values *values,
                             struct rp_controller_values *first,
                             struct rp_controller_values *second) {
    if (second != NULL) {
        const struct rp_controller_values *const from[SOURCES] = {values, first, second};
        struct rp_controller_values *const to[TARGETS] = {first, second};
        calculate(from, to);
    } else {
        // the compiler leaves out the second derivatives, which are not used
        struct rp_controller_values straight = {0};
        const struct rp_controller_values *const from[SOURCES] = {values, first, &straight};
        struct rp_controller_values *const to[TARGETS] = {first, &straight};
        calculate(from, to);
    }
}
