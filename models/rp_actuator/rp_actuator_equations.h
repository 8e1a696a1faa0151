/* The equations of a drive. rp_actuator.h explains symbols and limits. */
#pragma once

#include "../real.h"
#include "rp_actuator.h"

/* n k: effort per current, and back-EMF per velocity of the joint. */
static inline real drive_constant(const struct rp_actuator_parameters *p, int i) {
    return p->gear_ratio[i] * p->torque_constant[i];
}

static inline real drive_effort(const struct rp_actuator_parameters *p, real current, int i) {
    return drive_constant(p, i) * current;
}

static inline real drive_back_emf(const struct rp_actuator_parameters *p,
                                  const struct rp_actuator_inputs *inputs, int i) {
    return drive_constant(p, i) * inputs->dq[i];
}

static inline real drive_voltage(const struct rp_actuator_parameters *p,
                                 const struct rp_actuator_inputs *inputs, real current, int i) {
    return p->resistance[i] * current + drive_back_emf(p, inputs, i);
}

/* At a limit and beyond it the result moves with the limit. NaN stays NaN. */
static inline real drive_clipped(real x, real lowest, real highest) {
    if (x >= highest) {
        return highest;
    }
    return x <= lowest ? lowest : x;
}

/* The current (A) that the loop follows. The command cmd / (n k) is clipped to the currents that
 * the voltage allows, |R i + n k dq| <= voltage_max, and then to |i| <= current_max. The second
 * limit holds at any speed. The first one cannot where |n k dq| > voltage_max + R current_max:
 * there the result is the allowed current nearest to its range. */
static inline real drive_limited_current(const struct rp_actuator_parameters *p,
                                         const struct rp_actuator_inputs *inputs, int i) {
    const real back_emf = drive_back_emf(p, inputs, i);
    const real lowest = (-p->voltage_max[i] - back_emf) / p->resistance[i];
    const real highest = (p->voltage_max[i] - back_emf) / p->resistance[i];

    const real commanded = inputs->effort_cmd[i] / drive_constant(p, i);
    const real possible = drive_clipped(commanded, lowest, highest);
    return drive_clipped(possible, -p->current_max[i], p->current_max[i]);
}

static inline real drive_current_rate(const struct rp_actuator_parameters *p, real limited,
                                      real current, int i) {
    return (limited - current) / p->time_constant[i];
}

/* Rates of the currents (A/s): the right side. */
static inline void drive_current_rates(const struct rp_actuator_parameters *p,
                                       const struct rp_actuator_inputs *inputs,
                                       const real current[2], real rates[2]) {
    for (int i = 0; i < 2; i++) {
        const real limited = drive_limited_current(p, inputs, i);
        rates[i] = drive_current_rate(p, limited, current[i], i);
    }
}
