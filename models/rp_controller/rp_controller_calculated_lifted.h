/* The calculated fields of struct rp_controller_values, in any arithmetic (equation.h). */
#ifndef RP_CONTROLLER_CALCULATED_LIFTED_H
#define RP_CONTROLLER_CALCULATED_LIFTED_H

#include "rp_controller_law_lifted.h"
#include "rp_controller_model.h"

/* From the parameters, inputs and states; in the sampled form efforts are those of a sample. */
EQUATION void calculate(const struct rp_controller_values *const from[SOURCES],
                        struct rp_controller_values *const to[TARGETS]) {
    const struct rp_controller_parameters *const p[SOURCES] = PARTS(from, parameters);
    const struct rp_controller_inputs *const inputs[SOURCES] = PARTS(from, inputs);
    for (int i = 0; i < 2; i++) {
        WRITE(to, error[i], law_error(inputs, i));
        WRITE(to, derror[i], law_error_rate(inputs, i));
    }
    if (from[0]->form == RP_CONTROLLER_SAMPLED) {
        const struct rp_controller_command *command = &from[0]->samples.command;
        for (int i = 0; i < 2; i++) {
            WRITE(to, unlimited[i], constant(command->unlimited[i]));
            WRITE(to, effort[i], constant(command->effort[i]));
            WRITE(to, dintegral[i], constant(0.0));
        }
        return;
    }
    const real w[2] = {READ(from, integral[0]), READ(from, integral[1])};
    real unlimited[2];
    law_unlimited(p, from[0]->payload_attached != 0, inputs, w, unlimited);
    for (int i = 0; i < 2; i++) {
        WRITE(to, unlimited[i], unlimited[i]);
        WRITE(to, effort[i], law_limited(p, unlimited[i], i));
        WRITE(to, dintegral[i],
              p[0]->sample_time > 0.0 ? constant(0.0) // the first sample is still to come
                                      : law_integral_rate(p, inputs, unlimited[i], i));
    }
}

#endif
