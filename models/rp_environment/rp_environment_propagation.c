#include "rp_environment_propagation.h"

#include "arithmetic_taylor.h"
#include "rp_environment_equations.h"

void rp_environment_propagate(const struct rp_environment_values *values,
                              struct rp_environment_values *first,
                              struct rp_environment_values *second) {
    // without second derivatives, those of a straight line are calculated and dropped
    struct rp_environment_values straight = {0};
    struct rp_environment_values *const bend = second != NULL ? second : &straight;
    const struct rp_environment_values *const from[SOURCES] = {values, first, bend};
    struct rp_environment_values *const to[TARGETS] = {first, bend};
    calculate(from, to);
}
