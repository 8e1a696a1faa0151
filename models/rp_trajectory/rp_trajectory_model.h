/* The reference motions as the instance runs them: their value structure, to which variables.toml
 * binds the variables, and their struct model. No state and no input. */
#ifndef RP_TRAJECTORY_MODEL_H
#define RP_TRAJECTORY_MODEL_H

#include "model.h"
#include "rp_trajectory.h"

struct rp_trajectory_values {
    struct rp_trajectory_parameters parameters;

    /* calculated from the above and the time */
    double q[2];           /* rad, m */
    double dq[2];          /* rad/s, m/s */
    double ddq[2];         /* rad/s2, m/s2 */
    double ee_position[2]; /* m, frame 0 */
    double ee_velocity[2]; /* m/s, frame 0 */
};

extern const struct model rp_trajectory_model;

#endif
