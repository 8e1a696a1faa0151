/* Reference motions of the RP manipulator, twice continuously differentiable in time: from one
 * position of the joints to another, along a straight line, along a circle. Symbols and formulas as
 * in README.md. The equations are in rp_trajectory_equations.h. No function allocates, prints or
 * has state. */
#pragma once

#include <stdbool.h>

enum rp_trajectory_motion {
    RP_TRAJECTORY_POINT_TO_POINT = 1,
    RP_TRAJECTORY_LINE,
    RP_TRAJECTORY_CIRCLE,
};

/* Sign of L = l1 + q2. */
enum rp_trajectory_branch { RP_TRAJECTORY_FORWARD = 1, RP_TRAJECTORY_BACKWARD };

struct rp_trajectory_parameters {
    int motion; /* enum rp_trajectory_motion */
    int branch; /* enum rp_trajectory_branch; of line and circle */

    double l1;         /* m */
    double a;          /* m, any sign */
    double start_time; /* s */
    double duration;   /* s, > 0; of point_to_point and line */

    double q_from[2]; /* rad, m */
    double q_to[2];

    double ee_from[2]; /* m, frame 0 */
    double ee_to[2];

    double center[2];   /* m, frame 0 */
    double radius;      /* m, >= 0 */
    double start_angle; /* rad */
    double frequency;   /* Hz, not 0; its sign is the direction */
    double turns;       /* >= ramp_time |frequency| */
    double ramp_time;   /* s, > 0 */

    double grasp_time;   /* s */
    double release_time; /* s, >= grasp_time */
};

enum rp_trajectory_fault {
    RP_TRAJECTORY_VALID,
    RP_TRAJECTORY_NO_FREQUENCY,
    RP_TRAJECTORY_SHORT_TURNS,   /* turns / |frequency| < ramp_time */
    RP_TRAJECTORY_OUT_OF_REACH,  /* the path comes as near as |a| to the axis of joint 1 */
    RP_TRAJECTORY_EARLY_RELEASE, /* release_time < grasp_time */
};

/* Whether the parameters are consistent. Each must be within its range. */
enum rp_trajectory_fault rp_trajectory_check(const struct rp_trajectory_parameters *p);

/* Whether the payload is attached at the time t (s): grasp_time <= t < release_time. */
bool rp_trajectory_is_attached(const struct rp_trajectory_parameters *p, double t);

/* Smallest distance (m) of the line or the swept arc from the axis of joint 1; the nearest point
 * goes to nearest. INFINITY for point_to_point, every point of which can be reached. */
double rp_trajectory_distance(const struct rp_trajectory_parameters *p, double nearest[2]);
