#include "rp_actuator.h"

#include "arithmetic_double.h"
#include "rp_actuator_equations.h"

void rp_actuator_limited_currents(const struct rp_actuator_parameters *p,
                                  const struct rp_actuator_inputs *inputs, double limited[2]) {
    for (int i = 0; i < 2; i++) {
        limited[i] = drive_limited_current(&p, &inputs, i);
    }
}

void rp_actuator_current_rates(const struct rp_actuator_parameters *p,
                               const struct rp_actuator_inputs *inputs, const double current[2],
                               double rates[2]) {
    for (int i = 0; i < 2; i++) {
        rates[i] = drive_current_rate(&p, drive_limited_current(&p, &inputs, i), current[i], i);
    }
}

void rp_actuator_efforts(const struct rp_actuator_parameters *p, const double current[2],
                         double effort[2]) {
    for (int i = 0; i < 2; i++) {
        effort[i] = drive_effort(&p, current[i], i);
    }
}

void rp_actuator_voltages(const struct rp_actuator_parameters *p,
                          const struct rp_actuator_inputs *inputs, const double current[2],
                          double voltage[2]) {
    for (int i = 0; i < 2; i++) {
        voltage[i] = drive_voltage(&p, &inputs, current[i], i);
    }
}
