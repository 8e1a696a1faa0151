#include "rp_actuator_propagation.h"

#include "arithmetic_taylor.h"
#include "rp_actuator_calculated.h"

void rp_actuator_propagate(const struct rp_actuator_values *values,
                           struct rp_actuator_values *first, struct rp_actuator_values *second) {
    if (second != NULL) {
        const struct rp_actuator_values *const from[SOURCES] = {values, first, second};
        struct rp_actuator_values *const to[TARGETS] = {first, second};
        calculate(from, to);
    } else {
        // the compiler leaves out the second derivatives, which are not used
        struct rp_actuator_values straight = {0};
        const struct rp_actuator_values *const from[SOURCES] = {values, first, &straight};
        struct rp_actuator_values *const to[TARGETS] = {first, &straight};
        calculate(from, to);
    }
}
