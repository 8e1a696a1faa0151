/* The reference motions as the instance runs them: their value structure, to which variables.toml
 * binds the variables, and their struct model. No state and no input. */
#pragma once

#include "model.h"
#include "rp_trajectory.h"

/* Where the time is between grasp_time and release_time. */
enum rp_trajectory_payload {
    RP_TRAJECTORY_UNDECIDED = 0, /* until initialization ends */
    RP_TRAJECTORY_TO_GRASP = 1,
    RP_TRAJECTORY_ATTACHED = 2,
    RP_TRAJECTORY_RELEASED = 3, /* there is no grasp any more */
};

struct rp_trajectory_values {
    struct rp_trajectory_parameters parameters;
    int payload; /* mode: enum rp_trajectory_payload */

    /* calculated from the above and the time */
    double q[2];           /* rad, m */
    double dq[2];          /* rad/s, m/s */
    double ddq[2];         /* rad/s2, m/s2 */
    double ee_position[2]; /* m, frame 0 */
    double ee_velocity[2]; /* m/s, frame 0 */
    int payload_attached;
};

extern const struct model rp_trajectory_model;
