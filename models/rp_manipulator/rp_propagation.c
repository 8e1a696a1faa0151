#include "rp_propagation.h"

#include "arithmetic_taylor.h"
#include "rp_calculated.h"

void rp_propagate(const struct rp_values *values, struct rp_values *first,
                  struct rp_values *second) {
    if (second != NULL) {
        const struct rp_values *const from[SOURCES] = {values, first, second};
        struct rp_values *const to[TARGETS] = {first, second};
        calculate(from, to);
    } else {
        // the compiler leaves out the second derivatives, which are not used
        struct rp_values straight = {0};
        const struct rp_values *const from[SOURCES] = {values, first, &straight};
        struct rp_values *const to[TARGETS] = {first, &straight};
        calculate(from, to);
    }
}
