/* The controller as the instance runs it: its value structure, to which variables.toml binds the
 * variables, and its struct model. */
#pragma once

#include "model.h"
#include "rp_controller.h"

enum rp_controller_form {
    RP_CONTROLLER_UNDECIDED = 0, /* until initialization ends: the law acts continuously */
    RP_CONTROLLER_CONTINUOUS = 1,
    RP_CONTROLLER_SAMPLED = 2,
};

/* What the law asks for at a sample. */
struct rp_controller_command {
    double unlimited[2]; /* N.m, N */
    double effort[2];    /* N.m, N */
};

/* What the sampled form keeps from one event to the next; zeros in the other forms. The counts are
 * doubles, which are exact far beyond the largest int. */
struct rp_controller_samples {
    double start;                         /* s: time of sample 0 */
    double taken;                         /* number of samples so far */
    double shown;                         /* number of those whose efforts are or were in effect */
    double rate[2];                       /* rad/s3, m/s3: of the integral parts, at the last one */
    struct rp_controller_command command; /* in effect */
    struct rp_controller_command next;    /* of the last sample */
};

struct rp_controller_values {
    struct rp_controller_parameters parameters;
    struct rp_controller_inputs inputs;
    double integral[2]; /* states: rad/s2, m/s2 */

    int payload_attached;                 /* discrete input: 0 or 1 */
    int form;                             /* mode: enum rp_controller_form */
    struct rp_controller_samples samples; /* written at events */

    /* calculated from the above */
    double dintegral[2]; /* rad/s3, m/s3 */
    double unlimited[2]; /* N.m, N */
    double effort[2];    /* N.m, N */
    double error[2];     /* rad, m */
    double derror[2];    /* rad/s, m/s */
};

extern const struct model rp_controller_model;
