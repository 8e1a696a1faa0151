/* Control laws for the joints of the RP manipulator: PD, PD with gravity compensation and computed
 * torque, each with integral action, effort limits and anti-windup by back-calculation.
 *
 * Arrays have one element per joint: angles and torques of joint 1 (rad, N.m), displacements and
 * forces of joint 2 (m, N), with their rates. All functions are pure: they read their inputs, write
 * their trailing outputs, keep nothing, allocate nothing. Inputs are taken as they are. */
#pragma once

#include "rp_manipulator.h"

enum rp_controller_mode {
    RP_CONTROLLER_PD = 1,
    RP_CONTROLLER_PD_GRAVITY = 2,
    RP_CONTROLLER_COMPUTED_TORQUE = 3,
};

struct rp_controller_parameters {
    struct arm_parameters arm; /* what the controller believes of the arm */
    double Kp[2];              /* 1/s2, >= 0 */
    double Kd[2];              /* 1/s, >= 0 */
    double Ki[2];              /* 1/s3, >= 0; 0: the integral part rests */
    double inertia[2];         /* kg.m2, kg, > 0: effective inertias, of the PD modes and the
                                  anti-windup */
    double tracking_time;      /* s, > 0: time constant of the anti-windup */
    double limit[2];           /* N.m, N, >= 0: largest magnitude of the efforts */
    double payload_mass;       /* kg, >= 0 */
    double payload_inertia;    /* kg.m2, >= 0: about its center of mass, along z0 */
    double payload_x;          /* m: its center of mass in frame 2, along x2 */
    double payload_z;          /* m: the same, along z2 (the slide) */
    double sample_time;        /* s; 0: the law acts continuously */
    double delay;              /* s, 0 .. sample_time: from a sample to its efforts */
    int mode;                  /* enum rp_controller_mode */
};

/* References and measurements. */
struct rp_controller_inputs {
    double q_ref[2];   /* rad, m */
    double dq_ref[2];  /* rad/s, m/s */
    double ddq_ref[2]; /* rad/s2, m/s2 */
    double q[2];       /* rad, m */
    double dq[2];      /* rad/s, m/s */
};

/* Efforts u (N.m, N) that the law asks for, with the integral parts w of the commanded
 * accelerations (rad/s2, m/s2), in rp_controller_law.h. With a payload that the controller knows
 * of, link 2 has it in D, C and g. With the errors e = q_ref - q and
 * de = dq_ref - dq and, for each joint, v = Kp e + Kd de + w:
 *
 *   PD               M v                                       M: inertia
 *   PD with gravity  M v + g(q)
 *   computed torque  D(q) (ddq_ref + v) + C(q, dq) dq + g(q)
 *
 * The efforts are u brought into [-limit, limit]. Rates of the integral parts (rad/s3, m/s3):
 * Ki e + (effort - u) / (M tracking_time) where Ki > 0, else 0. */
