/* The calculated fields of struct rp_actuator_values. */
#pragma once

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

/* Derived: J[i + 2 j] is the derivative of rates[i] by current[j]. */
void rp_actuator_jacobian(const struct rp_actuator_parameters *p,
                          const struct rp_actuator_inputs *inputs, const double current[2],
                          double J[]);

/* Derived: first and, unless NULL, second derivatives of the calculated fields along a curve.
 * The other fields of first and second give the curve. A current is taken as free strictly within
 * its limits; at and beyond one it moves as this limit does. */
void rp_actuator_derivatives(const struct rp_actuator_values *values,
                             struct rp_actuator_values *first, struct rp_actuator_values *second);
