/* The controller as the instance runs it: its value structure, to which variables.toml binds the
 * variables, and its struct model. */
#ifndef RP_CONTROLLER_MODEL_H
#define RP_CONTROLLER_MODEL_H

#include "model.h"
#include "rp_controller.h"

struct rp_controller_values {
    struct rp_controller_parameters parameters;
    struct rp_controller_inputs inputs;
    double integral[2]; /* states: rad/s2, m/s2 */

    /* calculated from the above */
    double dintegral[2]; /* rad/s3, m/s3 */
    double unlimited[2]; /* N.m, N */
    double effort[2];    /* N.m, N */
    double error[2];     /* rad, m */
    double derror[2];    /* rad/s, m/s */
};

extern const struct model rp_controller_model;

#endif
