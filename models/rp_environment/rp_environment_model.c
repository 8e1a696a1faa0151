#include "rp_environment_model.h"

#include "arithmetic_double.h"
#include "calculated.h"
#include "rp_environment_equations.h"

#include <stdbool.h>
#include <stdio.h>

_Static_assert(sizeof(struct rp_environment_inputs) == sizeof(double[6]),
               "the inputs are one array of doubles");

static enum status right_hand_side(const void *values, double t, const double x[], const double u[],
                                   double dx[]) {
    return STATUS_OK; // there is no state
}

DEFINE_OUTPUTS(rp_environment_values)

/* A parameter with the range that it has to be in. */
struct checked {
    const char *name;
    double value;
    bool may_be_negative;
};

static enum status check_parameters(const void *values_pointer, char *text, size_t size) {
    const struct rp_environment_parameters *p =
        &((const struct rp_environment_values *)values_pointer)->parameters;
    const struct checked all[] = {
        {"stiffness", p->stiffness, false}, {"damping", p->damping, false},
        {"position", p->position, true},    {"angle", p->angle, true},
        {"tip_x", p->tip_x, true},          {"tip_z", p->tip_z, true},
    };
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++) {
        if (isfinite(all[i].value) && (all[i].may_be_negative || all[i].value >= 0.0)) {
            continue;
        }
        (void)snprintf(text, size, "%s = %.17g is refused: it must be finite%s", all[i].name,
                       all[i].value, all[i].may_be_negative ? "" : " and not below 0");
        return STATUS_INVALID_PARAMETERS;
    }
    return STATUS_OK;
}

const struct model rp_environment_model = {
    .values_size = sizeof(struct rp_environment_values),
    .parameters = {offsetof(struct rp_environment_values, parameters),
                   sizeof(struct rp_environment_parameters)},
    .inputs = {offsetof(struct rp_environment_values, inputs),
               sizeof(struct rp_environment_inputs)},
    .right_hand_side = right_hand_side,
    .outputs = outputs,
    .propagate = rp_environment_propagate,
    .check_parameters = check_parameters,
};
