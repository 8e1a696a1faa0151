#include "rp_plant_model.h"

#include "rp_plant_calculated.h"
#include "rp_plant_modes.h"

#include <string.h>

_Static_assert(sizeof(struct rp_plant_inputs) == sizeof(double[5]),
               "the inputs are one array of doubles");
_Static_assert(sizeof(struct rp_plant_modes) == sizeof(int[5]), "the modes are one array of ints");
_Static_assert(sizeof(struct rp_plant_sums) == sizeof(double[4]),
               "the sums are one array of doubles");
_Static_assert(offsetof(struct rp_plant_values, dq) ==
                   offsetof(struct rp_plant_values, q) + sizeof(double[2]),
               "the states are one array: q, then dq");
_Static_assert(offsetof(struct rp_plant_values, ddq) ==
                   offsetof(struct rp_plant_values, dq) + sizeof(double[2]),
               "their derivatives are one array: dq, then ddq");
_Static_assert((int)RP_PLANT_INDICATORS == 2 * (int)PLANT_INDICATORS, "five of each joint");

static enum status right_hand_side(const void *values_pointer, double t, const double x[],
                                   const double u[], double dx[]) {
    const struct rp_plant_values *values = values_pointer;
    struct rp_plant_inputs inputs;
    memcpy(&inputs, u, sizeof inputs);
    struct rp_plant_modes modes;
    rp_plant_modes_in_effect(values, x, x + 2, &inputs, &modes);
    struct rp_plant_motion motion;
    rp_plant_motion(&values->parameters, &modes, x, x + 2, &inputs, &motion);
    dx[0] = x[2];
    dx[1] = x[3];
    dx[2] = motion.ddq[0];
    dx[3] = motion.ddq[1];
    return STATUS_OK;
}

/* Derivatives by the state of a stuck joint are left out: it does not move, and an elimination that
 * exchanges rows would mix the rounding of the other joint into it. */
static enum status jacobian(const void *values_pointer, double t, const double x[],
                            const double u[], double J[]) {
    const struct rp_plant_values *values = values_pointer;
    struct rp_plant_inputs inputs;
    memcpy(&inputs, u, sizeof inputs);
    struct rp_plant_modes modes;
    rp_plant_modes_in_effect(values, x, x + 2, &inputs, &modes);
    double ddq_by[2 * 4];
    plant_accelerations_jacobian(&values->parameters, &modes, x, x + 2, &inputs, ddq_by);
    for (size_t j = 0; j < 2; j++) {
        double *by_q = J + 4 * j;
        double *by_dq = J + 4 * (2 + j);
        const bool is_stuck = modes.joint[j] == RP_PLANT_STUCK;
        for (size_t i = 0; i < 2; i++) {
            by_q[i] = 0.0;
            by_q[2 + i] = is_stuck ? 0.0 : ddq_by[i + 2 * j];
            by_dq[i] = i == j ? 1.0 : 0.0;
            by_dq[2 + i] = is_stuck ? 0.0 : ddq_by[i + 2 * (2 + j)];
        }
    }
    return STATUS_OK;
}

static enum status outputs(void *values_pointer, double t) {
    struct rp_plant_values *values = values_pointer;
    struct rp_plant_modes modes;
    rp_plant_modes_in_effect(values, values->q, values->dq, &values->inputs, &modes);
    rp_plant_calculate(values, &modes);
    return STATUS_OK;
}

static enum status propagate(const void *values_pointer, double t, double dt, void *first,
                             void *second) {
    const struct rp_plant_values *values = values_pointer;
    struct rp_plant_modes modes;
    rp_plant_modes_in_effect(values, values->q, values->dq, &values->inputs, &modes);
    rp_plant_derivatives(values, &modes, first, second);
    return STATUS_OK;
}

const struct model rp_plant_model = {
    .values_size = sizeof(struct rp_plant_values),
    .parameters = {offsetof(struct rp_plant_values, parameters),
                   sizeof(struct rp_plant_parameters)},
    .inputs = {offsetof(struct rp_plant_values, inputs), sizeof(struct rp_plant_inputs)},
    .states = {offsetof(struct rp_plant_values, q), sizeof(double[4])},
    .derivatives = {offsetof(struct rp_plant_values, dq), sizeof(double[4])},
    .right_hand_side = right_hand_side,
    .jacobian = jacobian,
    .series = &rp_plant_series,
    .outputs = outputs,
    .propagate = propagate,
    .check_parameters = rp_plant_check_parameters,
    .events = &rp_plant_events,
};
