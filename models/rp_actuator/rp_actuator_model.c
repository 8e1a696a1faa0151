#include "rp_actuator_model.h"

#include "rp_actuator_calculated.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

_Static_assert(sizeof(struct rp_actuator_inputs) == sizeof(double[4]),
               "the inputs are one array of doubles");

static const double GEAR_RATIO_MIN = 1e-9; /* magnitude: commands are divided by it */

static enum status right_hand_side(const void *values_pointer, double t, const double x[],
                                   const double u[], double dx[]) {
    const struct rp_actuator_parameters *p =
        &((const struct rp_actuator_values *)values_pointer)->parameters;
    struct rp_actuator_inputs inputs;
    memcpy(&inputs, u, sizeof inputs);
    drive_current_rates(p, &inputs, x, dx);
    return STATUS_OK;
}

static enum status jacobian(const void *values_pointer, double t, const double x[],
                            const double u[], double J[]) {
    const struct rp_actuator_values *values = values_pointer;
    struct rp_actuator_inputs inputs;
    memcpy(&inputs, u, sizeof inputs);
    rp_actuator_jacobian(&values->parameters, &inputs, x, J);
    return STATUS_OK;
}

static enum status outputs(void *values, double t) {
    rp_actuator_calculate(values);
    return STATUS_OK;
}

static enum status propagate(const void *values, double t, double dt, void *first, void *second) {
    rp_actuator_derivatives(values, first, second);
    return STATUS_OK;
}

static enum status check_parameters(const void *values_pointer, char *text, size_t size) {
    const struct rp_actuator_parameters *p =
        &((const struct rp_actuator_values *)values_pointer)->parameters;
    for (int i = 0; i < 2; i++) {
        if (!(fabs(p->gear_ratio[i]) >= GEAR_RATIO_MIN)) {
            (void)snprintf(text, size,
                           "gear_ratio%d = %g is refused: its magnitude must be %g or more", i + 1,
                           p->gear_ratio[i], GEAR_RATIO_MIN);
            return STATUS_INVALID_PARAMETERS;
        }
    }
    return STATUS_OK;
}

const struct model rp_actuator_model = {
    .values_size = sizeof(struct rp_actuator_values),
    .parameters = {offsetof(struct rp_actuator_values, parameters),
                   sizeof(struct rp_actuator_parameters)},
    .inputs = {offsetof(struct rp_actuator_values, inputs), sizeof(struct rp_actuator_inputs)},
    .states = {offsetof(struct rp_actuator_values, current), sizeof(double[2])},
    .derivatives = {offsetof(struct rp_actuator_values, dcurrent), sizeof(double[2])},
    .right_hand_side = right_hand_side,
    .jacobian = jacobian,
    .outputs = outputs,
    .propagate = propagate,
    .check_parameters = check_parameters,
};
