/* The calculated fields of struct rp_actuator_values. */
#ifndef RP_ACTUATOR_CALCULATED_H
#define RP_ACTUATOR_CALCULATED_H

#include "rp_actuator_equations.h"
#include "rp_actuator_model.h"

/* Writes them from the parameters, inputs and states. */
static inline void rp_actuator_calculate(struct rp_actuator_values *values) {
    const struct rp_actuator_parameters *p = &values->parameters;
    const struct rp_actuator_inputs *inputs = &values->inputs;
    for (int i = 0; i < 2; i++) {
        const real current = values->current[i];
        const real limited = drive_limited_current(p, inputs, i);
        values->limited[i] = limited;
        values->dcurrent[i] = drive_current_rate(p, limited, current, i);
        values->effort[i] = drive_effort(p, current, i);
        values->voltage[i] = drive_voltage(p, inputs, current, i);
    }
}

#endif
