/* The calculated fields of struct rp_sensor_values that are real. */
#pragma once

#include "../real.h"
#include "rp_sensor_model.h"

/* Writes them from the parameters and the counts that are shown now and were shown a tick before.
 */
static inline void rp_sensor_calculate(struct rp_sensor_values *values, const int now[2],
                                       const int before[2]) {
    const struct rp_sensor_parameters *p = &values->parameters;
    for (int i = 0; i < 2; i++) {
        const real counts = now[i]; // the difference may exceed the largest int
        values->q_measured[i] = counts * p->resolution[i];
        values->dq_measured[i] = (counts - before[i]) * p->resolution[i] / p->sample_time;
    }
}
