#include "rp_model.h"

#include "rp_calculated.h"
#include "rp_series.h"

static enum status right_hand_side(const void *values_pointer, double t, const double x[],
                                   const double u[], double dx[]) {
    const struct rp_values *values = values_pointer;
    rp_right_hand_side(&values->parameters, x, u, dx);
    return STATUS_OK;
}

static enum status jacobian(const void *values_pointer, double t, const double x[],
                            const double u[], double J[]) {
    const struct rp_values *values = values_pointer;
    rp_jacobian(&values->parameters, x, u, J);
    return STATUS_OK;
}

static enum status outputs(void *values, double t) {
    rp_calculate(values);
    return STATUS_OK;
}

static enum status propagate(const void *values, double t, double dt, void *first, void *second) {
    rp_derivatives(values, first, second);
    return STATUS_OK;
}

static enum status check_parameters(const void *values_pointer, char *text, size_t size) {
    const struct rp_values *values = values_pointer;
    return rp_parameters_check(&values->parameters, text, size) ? STATUS_OK
                                                                : STATUS_INVALID_PARAMETERS;
}

const struct model rp_model = {
    .values_size = sizeof(struct rp_values),
    .parameters = {offsetof(struct rp_values, parameters), sizeof(struct rp_parameters)},
    .inputs = {offsetof(struct rp_values, tau), sizeof(double[2])},
    .states = {offsetof(struct rp_values, q), sizeof(double[4])},
    .derivatives = {offsetof(struct rp_values, dq), sizeof(double[4])},
    .right_hand_side = right_hand_side,
    .jacobian = jacobian,
    .series = &rp_series,
    .outputs = outputs,
    .propagate = propagate,
    .check_parameters = check_parameters,
};

_Static_assert(offsetof(struct rp_values, dq) == offsetof(struct rp_values, q) + sizeof(double[2]),
               "the states are one array: q, then dq");
_Static_assert(offsetof(struct rp_values, ddq) ==
                   offsetof(struct rp_values, dq) + sizeof(double[2]),
               "their derivatives are one array: dq, then ddq");
