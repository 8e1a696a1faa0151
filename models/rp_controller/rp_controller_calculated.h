/* The calculated fields of struct rp_controller_values. */
#ifndef RP_CONTROLLER_CALCULATED_H
#define RP_CONTROLLER_CALCULATED_H

#include "rp_controller_law.h"
#include "rp_controller_model.h"

/* Writes them from the parameters, inputs and states; in the sampled form efforts are those of a
 * sample, which do not move. */
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

#endif
