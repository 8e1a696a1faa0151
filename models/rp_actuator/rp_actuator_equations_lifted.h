/* The equations of a drive in any arithmetic (equation.h). rp_actuator.h, with doubles, explains
 * symbols and limits. */
#ifndef RP_ACTUATOR_EQUATIONS_LIFTED_H
#define RP_ACTUATOR_EQUATIONS_LIFTED_H

#include "equation.h"
#include "rp_actuator.h"

/* n k: effort per current, and back-EMF per velocity of the joint. */
EQUATION real drive_constant(const struct rp_actuator_parameters *const p[SOURCES], int i) {
    return times(READ(p, gear_ratio[i]), READ(p, torque_constant[i]));
}

/* n k i */
EQUATION real drive_effort(const struct rp_actuator_parameters *const p[SOURCES], real current,
                           int i) {
    return times(drive_constant(p, i), current);
}

EQUATION real drive_back_emf(const struct rp_actuator_parameters *const p[SOURCES],
                             const struct rp_actuator_inputs *const inputs[SOURCES], int i) {
    return times(drive_constant(p, i), READ(inputs, dq[i]));
}

/* R i + n k dq */
EQUATION real drive_voltage(const struct rp_actuator_parameters *const p[SOURCES],
                            const struct rp_actuator_inputs *const inputs[SOURCES], real current,
                            int i) {
    return plus(times(READ(p, resistance[i]), current), drive_back_emf(p, inputs, i));
}

/* At a limit and beyond it the result moves with the limit. NaN stays NaN. */
EQUATION real drive_clipped(real x, real lowest, real highest) {
    if (value_of(x) >= value_of(highest)) {
        return highest;
    }
    return value_of(x) <= value_of(lowest) ? lowest : x;
}

EQUATION real drive_limited_current(const struct rp_actuator_parameters *const p[SOURCES],
                                    const struct rp_actuator_inputs *const inputs[SOURCES], int i) {
    const real resistance = READ(p, resistance[i]);
    const real voltage_max = READ(p, voltage_max[i]);
    const real current_max = READ(p, current_max[i]);
    const real back_emf = drive_back_emf(p, inputs, i);
    const real lowest = quotient(minus(negative(voltage_max), back_emf), resistance);
    const real highest = quotient(minus(voltage_max, back_emf), resistance);

    const real commanded = quotient(READ(inputs, effort_cmd[i]), drive_constant(p, i));
    const real possible = drive_clipped(commanded, lowest, highest);
    // last, so that it holds where both limits cannot
    return drive_clipped(possible, negative(current_max), current_max);
}

EQUATION real drive_current_rate(const struct rp_actuator_parameters *const p[SOURCES],
                                 real limited, real current, int i) {
    return quotient(minus(limited, current), READ(p, time_constant[i]));
}

#endif
