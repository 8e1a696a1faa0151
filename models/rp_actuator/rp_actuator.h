/* Drives of the RP manipulator: a motor without inertia at each joint, with gear, current loop, and
 * limits of current and voltage.
 *
 * Arrays have one element per joint: torques and angles of joint 1 (N.m, rad), forces and
 * displacements of joint 2 (N, m). A gear ratio is motor angle over joint variable (1, rad/m). The
 * functions of rp_actuator_equations.h are pure and take their arguments as they are. */
#pragma once

struct rp_actuator_parameters {
    double torque_constant[2]; /* k in N.m/A, > 0; the back-EMF constant in V.s/rad is the same */
    double gear_ratio[2];      /* n in 1, rad/m; not 0; < 0: motor and joint turn opposite ways */
    double resistance[2];      /* R in ohm, > 0 */
    double current_max[2];     /* A, > 0 */
    double voltage_max[2];     /* V, > 0 */
    double time_constant[2];   /* s, > 0: of the current loop */
};

struct rp_actuator_inputs {
    double effort_cmd[2]; /* N.m, N */
    double dq[2];         /* rad/s, m/s */
};
