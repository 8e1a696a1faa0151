#include "rp_model.h"

#include "rp_calculated.h"
#include "rp_series.h"

static enum status right_hand_side(const void *values_pointer, double t, const double x[],
                                   const double u[], double dx[]) {
    const struct rp_parameters *p = &((const struct rp_values *)values_pointer)->parameters;
    dx[0] = x[2];
    dx[1] = x[3];
    arm_accelerations(p, x, x + 2, u, dx + 2);
    return STATUS_OK;
}

static enum status jacobian(const void *values_pointer, double t, const double x[],
                            const double u[], double J[]) {
    const struct rp_values *values = values_pointer;
    struct rp_dynamics_jacobians ddq_by;
    rp_dynamics_jacobians(&values->parameters, x, x + 2, u, &ddq_by);
    for (size_t j = 0; j < 2; j++) {
        double *by_q = J + 4 * j;
        double *by_dq = J + 4 * (2 + j);
        for (size_t i = 0; i < 2; i++) {
            by_q[i] = 0.0;
            by_q[2 + i] = ddq_by.q[i][j];
            by_dq[i] = i == j ? 1.0 : 0.0;
            by_dq[2 + i] = ddq_by.dq[i][j];
        }
    }
    return STATUS_OK;
}

static enum status outputs(void *values, double t) {
    rp_calculate(values);
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
    .propagate = rp_propagate,
    .check_parameters = check_parameters,
};

_Static_assert(offsetof(struct rp_values, dq) == offsetof(struct rp_values, q) + sizeof(double[2]),
               "the states are one array: q, then dq");
_Static_assert(offsetof(struct rp_values, ddq) ==
                   offsetof(struct rp_values, dq) + sizeof(double[2]),
               "their derivatives are one array: dq, then ddq");
