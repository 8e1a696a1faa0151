/* The sensor as the instance runs it: its value structure, to which variables.toml binds the
 * variables, and its struct model. It has no continuous states; the samples are modes. */
#pragma once

#include "model.h"
#include "rp_sensor.h"

enum {
    RP_SENSOR_LATENCY_MAX = 64,                   /* ticks */
    RP_SENSOR_SAMPLES = RP_SENSOR_LATENCY_MAX + 2 /* kept: the shown one and that before it, too */
};

struct rp_sensor_parameters {
    double sample_time;   /* s */
    double resolution[2]; /* per count: rad, m */
    double noise[2];      /* standard deviation: rad, m */
    int latency;          /* ticks */
    int seed;
};

struct rp_sensor_values {
    struct rp_sensor_parameters parameters;

    double q[2]; /* inputs: rad, m */

    /* calculated */
    double q_measured[2];  /* rad, m */
    double dq_measured[2]; /* rad/s, m/s */
    int counts[2];

    /* modes: the count of tick k is at k modulo RP_SENSOR_SAMPLES */
    int samples[RP_SENSOR_SAMPLES][2];

    /* discrete states */
    double start; /* s: time of tick 0 */
    double ticks; /* so many have been; a double counts on where an int ends */
};

extern const struct model rp_sensor_model;
