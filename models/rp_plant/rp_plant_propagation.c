#include "rp_plant_propagation.h"

#include "arithmetic_taylor.h"
#include "rp_plant_calculated.h"

void rp_plant_propagate(const struct rp_plant_values *values, const struct rp_plant_modes *modes,
                        struct rp_plant_values *first, struct rp_plant_values *second) {
    if (second != NULL) {
        const struct rp_plant_values *const from[SOURCES] = {values, first, second};
        struct rp_plant_values *const to[TARGETS] = {first, second};
        calculate(from, modes, to);
    } else {
        // the compiler leaves out the second derivatives, which are not used
        struct rp_plant_values straight = {0};
        const struct rp_plant_values *const from[SOURCES] = {values, first, &straight};
        struct rp_plant_values *const to[TARGETS] = {first, &straight};
        calculate(from, modes, to);
    }
}
