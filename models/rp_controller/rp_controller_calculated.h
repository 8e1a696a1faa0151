/* The calculated fields of struct rp_controller_values. */
#pragma once

#include "rp_controller_law.h"
#include "rp_controller_model.h"

/* Writes them from the parameters, inputs and states; in the sampled form efforts belong to a
 * sample and do not move. */
static inline void rp_controller_calculate(struct rp_controller_values *values) {
    const struct rp_controller_parameters *p = &values->parameters;
    const struct rp_controller_inputs *inputs = &values->inputs;
    for (int i = 0; i < 2; i++) {
        values->error[i] = law_error(inputs, i);
        values->derror[i] = law_error_rate(inputs, i);
    }
    if (values->form == RP_CONTROLLER_SAMPLED) {
        const struct rp_controller_command *command = &values->samples.command;
        for (int i = 0; i < 2; i++) {
            values->unlimited[i] = value_of(command->unlimited[i]);
            values->effort[i] = value_of(command->effort[i]);
            values->dintegral[i] = 0.0;
        }
        return;
    }
    real unlimited[2];
    law_unlimited(p, values->payload_attached != 0, inputs, values->integral, unlimited);
    for (int i = 0; i < 2; i++) {
        values->unlimited[i] = unlimited[i];
        values->effort[i] = law_limited(p, unlimited[i], i);
        values->dintegral[i] = p->sample_time > 0.0 // the first sample is still to come
                                   ? 0.0
                                   : law_integral_rate(p, inputs, unlimited[i], i);
    }
}

/* Derived: J[i + 2 j] is the derivative of rates[i] by w[j] (1/s). One-sided where an effort just
 * meets its limit. */
void rp_controller_jacobian(const struct rp_controller_parameters *p, bool attached,
                            const struct rp_controller_inputs *inputs, const double w[2],
                            double J[]);

/* Derived: first and, unless NULL, second derivatives of the calculated fields along a curve.
 * The other fields of first and second give the curve. An effort is taken as free strictly within
 * its limits; at and beyond them it is the limit, which moves only with tau1_max and f2_max. Where
 * it just meets its limit, derivatives are one-sided. */
void rp_controller_derivatives(const struct rp_controller_values *values,
                               struct rp_controller_values *first,
                               struct rp_controller_values *second);
