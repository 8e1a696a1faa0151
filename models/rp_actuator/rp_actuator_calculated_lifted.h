/* The calculated fields of struct rp_actuator_values, in any arithmetic (equation.h). */
#ifndef RP_ACTUATOR_CALCULATED_LIFTED_H
#define RP_ACTUATOR_CALCULATED_LIFTED_H

#include "rp_actuator_equations_lifted.h"
#include "rp_actuator_model.h"

/* From the parameters, inputs and states. */
EQUATION void calculate(const struct rp_actuator_values *const from[SOURCES],
                        struct rp_actuator_values *const to[TARGETS]) {
    const struct rp_actuator_parameters *const p[SOURCES] = PARTS(from, parameters);
    const struct rp_actuator_inputs *const inputs[SOURCES] = PARTS(from, inputs);
    for (int i = 0; i < 2; i++) {
        const real current = READ(from, current[i]);
        const real limited = drive_limited_current(p, inputs, i);
        WRITE(to, limited[i], limited);
        WRITE(to, dcurrent[i], drive_current_rate(p, limited, current, i));
        WRITE(to, effort[i], drive_effort(p, current, i));
        WRITE(to, voltage[i], drive_voltage(p, inputs, current, i));
    }
}

#endif
