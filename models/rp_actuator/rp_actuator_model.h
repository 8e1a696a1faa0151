/* The drives as the instance runs them: their value structure, to which variables.toml binds the
 * variables, and their struct model. */
#pragma once

#include "model.h"
#include "rp_actuator.h"

struct rp_actuator_values {
    struct rp_actuator_parameters parameters;
    struct rp_actuator_inputs inputs;
    double current[2]; /* states: A */

    /* calculated from the above */
    double dcurrent[2]; /* A/s */
    double limited[2];  /* A */
    double effort[2];   /* N.m, N */
    double voltage[2];  /* V */
};

extern const struct model rp_actuator_model;
