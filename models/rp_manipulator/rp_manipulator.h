/* Equations of the planar Revolute-Prismatic (RP) manipulator.
 *
 * Source of every equation number below: "Example of dynamics computation (Euler-Lagrange and
 * Newton-Euler formulations): Revolute-Prismatic (RP) manipulator (Problem 7.8)", "the notes".
 *
 * Joint 1 turns the L-shaped link 1 about z0 by q[0] (rad); joint 2 slides link 2 by q[1] (m) along
 * the long side of link 1. Frame 0 is fixed: x0 to the right, y0 upward, z0 out of the page.
 * Frames 1 and 2 turn with link 1: x along the short side a, y parallel to z0, z along the slide.
 * SI units throughout; generalized forces tau = (torque on joint 1 in N.m, force on joint 2 in N).
 *
 * The equations themselves are in rp_equations.h and rp_recursion.h, once for values and
 * derivatives; the functions here are their values.
 *
 * All functions are pure: they read their inputs, write their trailing outputs, keep nothing,
 * allocate nothing. Inputs are taken as they are; results for parameters that
 * rp_parameters_check refuses, and for states that overflow, may be infinite or NaN. */
#ifndef RP_MANIPULATOR_H
#define RP_MANIPULATOR_H

#include <stdbool.h>

struct rp_parameters {
    double m1;  /* kg, >= 0: mass of link 1 */
    double m2;  /* kg, > 0: mass of link 2 */
    double I1z; /* kg.m2, >= 0: moment of inertia of link 1 about its center of mass, along z0 */
    double I2z; /* kg.m2, >= 0: the same of link 2 */
    double l1;  /* m, >= 0: long side of link 1 (the notes write l and l1 for it) */
    double lc1; /* m, >= 0: distance from the joint axis to the center of mass of link 1 */
    double a;   /* m: short side of link 1, the offset of the slide from the joint axis */
    double g;   /* m/s2: gravitational acceleration along -y0; 0 is the horizontal plane */
};

/* True where the equations have a solution: every parameter finite and within the range stated in
 * struct rp_parameters, and m1 lc1^2 + I1z + I2z > 0, without which link 2 at L = 0 leaves joint 1
 * without inertia. */
bool rp_parameters_check(const struct rp_parameters *p);

/* m1 lc1^2 + I1z + I2z, the inertia about z0 that does not depend on the slide (kg.m2). */
double rp_fixed_inertia(const struct rp_parameters *p);

/* ---- Kinematics (rp_kinematics.c) ---------------------------------------------------------- */

/* One row of the Denavit-Hartenberg table. */
struct rp_dh_row {
    double a;     /* m */
    double alpha; /* rad */
    double d;     /* m */
    double theta; /* rad */
};

/* Denavit-Hartenberg table of the notes for links 1 and 2. */
void rp_dh_table(const struct rp_parameters *p, const double q[2], struct rp_dh_row rows[2]);

/* Homogeneous transform of one row, Rot_z(theta) Trans_z(d) Trans_x(a) Rot_x(alpha). */
void rp_dh_transform(const struct rp_dh_row *row, double A[4][4]);

/* Pose of frame 2 in frame 0: product of the two transforms of the table. */
void rp_forward_kinematics(const struct rp_parameters *p, const double q[2], double T[4][4]);

/* End effector, the origin of frame 2, in frame 0: position (x, y) in m and velocity in m/s. */
void rp_end_effector_position(const struct rp_parameters *p, const double q[2], double position[2]);
void rp_end_effector_velocity(const struct rp_parameters *p, const double q[2], const double dq[2],
                              double velocity[2]);

/* The two solutions of the inverse kinematics: the end effector ahead of the joint axis on the
 * slide (L = l1 + q2 >= 0) or drawn back past it (L <= 0). */
enum rp_branch { RP_BRANCH_FORWARD, RP_BRANCH_BACKWARD };

/* Joint variables that bring the end effector to position; q[0] in (-pi, pi].
 * False, with q unchanged, if the target is nearer to the joint axis than |a|, the smallest
 * reachable distance, or is not finite. At L = 0 = a every q[0] is a solution; 0 is returned. */
bool rp_inverse_kinematics(const struct rp_parameters *p, const double position[2],
                           enum rp_branch branch, double q[2]);

/* Angular velocity Jacobians of link 1 (1) and link 2 (2); both are the same constant matrix. */
void rp_jacobian_angular(double J[3][2]);

/* Linear velocity Jacobians (3) of the centers of mass of link 1 and link 2, in frame 0. */
void rp_jacobian_linear_link1(const struct rp_parameters *p, const double q[2], double J[3][2]);
void rp_jacobian_linear_link2(const struct rp_parameters *p, const double q[2], double J[3][2]);

/* ---- Euler-Lagrange dynamics (rp_manipulator.c) --------------------------------------------- */

/* Mass matrix D(q), (6)-(8). Symmetric and positive definite, det D = m2 J. */
void rp_mass_matrix(const struct rp_parameters *p, const double q[2], double D[2][2]);

/* Christoffel symbols (9): c[i][j][k] is c_{(i+1)(j+1)(k+1)} of the notes, symmetric in i, j. */
void rp_christoffel(const struct rp_parameters *p, const double q[2], double c[2][2][2]);

/* Coriolis matrix C(q, dq), (12); dD/dt - 2 C is skew symmetric. */
void rp_coriolis_matrix(const struct rp_parameters *p, const double q[2], const double dq[2],
                        double C[2][2]);

/* C(q, dq) dq, the velocity terms of (14) and (15): N.m, N. */
void rp_coriolis_forces(const struct rp_parameters *p, const double q[2], const double dq[2],
                        double forces[2]);

/* Potential energy P (10), J; zero where both centers of mass are at the height of joint 1. */
double rp_potential_energy(const struct rp_parameters *p, const double q[2]);

/* g(q) = dP/dq, (11): N.m, N. */
void rp_gravity_forces(const struct rp_parameters *p, const double q[2], double forces[2]);

/* Kinetic energy dq' D(q) dq / 2, J. */
double rp_kinetic_energy(const struct rp_parameters *p, const double q[2], const double dq[2]);

/* Generalized forces that a motion takes, the left side of (13), written out in (14) and (15). */
void rp_inverse_dynamics(const struct rp_parameters *p, const double q[2], const double dq[2],
                         const double ddq[2], double tau[2]);

/* Accelerations, (13) solved for ddq: rad/s2, m/s2. */
void rp_forward_dynamics(const struct rp_parameters *p, const double q[2], const double dq[2],
                         const double tau[2], double ddq[2]);

/* Derivatives of rp_forward_dynamics: row i, column j is
 * d ddq[i] / d (argument)[j]. */
struct rp_dynamics_jacobians {
    double q[2][2];
    double dq[2][2];
    double tau[2][2]; /* the inverse of D(q) */
};

void rp_dynamics_jacobians(const struct rp_parameters *p, const double q[2], const double dq[2],
                           const double tau[2], struct rp_dynamics_jacobians *jacobians);

/* ---- Newton-Euler recursion (rp_newton_euler.c) --------------------------------------------- */

/* Motion of the links, each vector in the frame of its link (frames 1 and 2 are parallel). */
struct rp_link_motion {
    double omega[3];  /* rad/s: angular velocity, of both links */
    double domega[3]; /* rad/s2: angular acceleration, of both links */
    double ac1[3];    /* m/s2: center of mass of link 1 (16) */
    double ae1[3];    /* m/s2: end of link 1 (17) */
    double ac2[3];    /* m/s2: center of mass of link 2 (18), with the Coriolis term corrected */
};

/* Force and moment that each link receives through its joint, in the frame of the link. */
struct rp_joint_loads {
    double f1[3];   /* N, (21) and (23) */
    double tau1[3]; /* N.m, (22); tau1[1] drives joint 1 (26) */
    double f2[3];   /* N, (19), (24) and (25); f2[2] drives joint 2 (27) */
    double tau2[3]; /* N.m, (20) */
};

/* Forward recursion (16)-(18).
 *
 * Departs from the notes in (18): as printed it has one q1' q2' i, where the Coriolis acceleration
 * 2 omega x q2' k needs two. The printed term leaves (26) short of m2 L q1' q2' against (14). */
void rp_newton_euler_forward(const struct rp_parameters *p, const double q[2], const double dq[2],
                             const double ddq[2], struct rp_link_motion *motion);

/* Backward recursion (19)-(25) from the motion that the forward recursion gave. */
void rp_newton_euler_backward(const struct rp_parameters *p, const double q[2],
                              const struct rp_link_motion *motion, struct rp_joint_loads *loads);

/* Both recursions: all joint loads of a motion; tau = (tau1[1], f2[2]) by (26) and (27). */
void rp_newton_euler(const struct rp_parameters *p, const double q[2], const double dq[2],
                     const double ddq[2], struct rp_joint_loads *loads);

#endif
