#include "rp_controller_model.h"

#include "rp_controller_calculated.h"
#include "rp_controller_events.h"

#include <stdio.h>
#include <string.h>

_Static_assert(sizeof(struct rp_controller_inputs) == sizeof(double[10]),
               "the inputs are one array of doubles");
_Static_assert(sizeof(struct rp_controller_samples) == sizeof(double[13]),
               "what events keep is one array of doubles");

static enum status right_hand_side(const void *values_pointer, double t, const double x[],
                                   const double u[], double dx[]) {
    const struct rp_controller_values *values = values_pointer;
    if (values->form == RP_CONTROLLER_SAMPLED) {
        dx[0] = dx[1] = 0.0;
        return STATUS_OK;
    }
    struct rp_controller_inputs inputs;
    memcpy(&inputs, u, sizeof inputs);
    law_integral_rates(&values->parameters, values->payload_attached != 0, &inputs, x, dx);
    return STATUS_OK;
}

static enum status jacobian(const void *values_pointer, double t, const double x[],
                            const double u[], double J[]) {
    const struct rp_controller_values *values = values_pointer;
    if (values->form == RP_CONTROLLER_SAMPLED) {
        memset(J, 0, 4 * sizeof J[0]);
        return STATUS_OK;
    }
    struct rp_controller_inputs inputs;
    memcpy(&inputs, u, sizeof inputs);
    rp_controller_jacobian(&values->parameters, values->payload_attached != 0, &inputs, x, J);
    return STATUS_OK;
}

static enum status outputs(void *values, double t) {
    rp_controller_calculate(values);
    return STATUS_OK;
}

static enum status derivatives(const void *values, double t, double dt, void *first, void *second) {
    rp_controller_derivatives(values, first, second);
    return STATUS_OK;
}

static enum status check_parameters(const void *values_pointer, char *text, size_t size) {
    const struct rp_controller_parameters *p =
        &((const struct rp_controller_values *)values_pointer)->parameters;
    if (!rp_parameters_check(&p->arm, text, size)) {
        return STATUS_INVALID_PARAMETERS;
    }
    if (p->sample_time > 0.0 && p->sample_time < rp_controller_shortest_sample_time) {
        (void)snprintf(text, size,
                       "sample_time = %g s is refused: it must be 0, for a continuous law, or at "
                       "least %g s",
                       p->sample_time, rp_controller_shortest_sample_time);
        return STATUS_INVALID_PARAMETERS;
    }
    if (p->delay > p->sample_time) {
        (void)snprintf(text, size,
                       "delay = %.17g s is refused: it must not be above sample_time = %.17g s",
                       p->delay, p->sample_time);
        return STATUS_INVALID_PARAMETERS;
    }
    return STATUS_OK;
}

const struct model rp_controller_model = {
    .values_size = sizeof(struct rp_controller_values),
    .parameters = {offsetof(struct rp_controller_values, parameters),
                   sizeof(struct rp_controller_parameters)},
    .inputs = {offsetof(struct rp_controller_values, inputs), sizeof(struct rp_controller_inputs)},
    .states = {offsetof(struct rp_controller_values, integral), sizeof(double[2])},
    .dx = {offsetof(struct rp_controller_values, dintegral), sizeof(double[2])},
    .right_hand_side = right_hand_side,
    .jacobian = jacobian,
    .outputs = outputs,
    .derivatives = derivatives,
    .check_parameters = check_parameters,
    .events = &rp_controller_events,
};
