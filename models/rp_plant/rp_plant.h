/* Equations of the plant: the RP manipulator (rp_manipulator.h) with what a real one has: armature
 * and damping of its drives, dry friction, stops, a wrench at its end effector, a payload.
 *
 *   D q'' + C q' + g = tau + Q - damping q' - friction + stop                     (N.m, N)
 *
 * Frames, joints and symbols are those of rp_manipulator.h; arrays have one element per joint: rad,
 * rad/s, N.m of joint 1 and m, m/s, N of joint 2. The wrench has the force along x0 and y0 and the
 * moment about z0 that act on link 2 at the end effector, the origin of frame 2. Each feature is
 * off while its parameters are 0 or none.
 *
 * The structs of parameters, inputs and modes are made of rp_plant.toml. The equations are in
 * rp_plant_equations.h; the functions here call them.
 * All functions are pure and allocate nothing. */
#pragma once

#include "../rp_manipulator/rp_manipulator.h"
#include "rp_plant_values.h"

#include <stdbool.h>

enum rp_plant_joint_mode {
    RP_PLANT_BACKWARD = -1, /* slides, friction drives it forward */
    RP_PLANT_STUCK = 0,     /* at rest, by friction or on a closed stop */
    RP_PLANT_FORWARD = 1,   /* slides, friction drives it backward */
    RP_PLANT_FREE = 2,      /* moves without friction */
};

/* Contact of a joint with a compliant stop, times the side: 1 at the lower stop, -1 at the upper.
 */
enum rp_plant_contact {
    RP_PLANT_APART = 0,
    RP_PLANT_PUSHED = 1, /* the stop pushes the joint back */
    RP_PLANT_LET_GO = 2, /* the joint leaves faster than the stop can follow: no force */
};

enum rp_plant_payload_mode {
    RP_PLANT_UNDECIDED = 0, /* until initialization ends: no mode has been decided */
    RP_PLANT_ATTACHED = 1,
    RP_PLANT_RELEASED = 2,
};

struct rp_plant_inertia {
    double D[2][2];     /* kg.m2, kg.m, kg: mass matrix with armature and payload */
    double determinant; /* D11 D22 - D12^2, without cancellation; > 0 */
};

/* A motion in given modes, which need not be those that follow from the rest. */
struct rp_plant_motion {
    double ddq[2];      /* rad/s2, m/s2; 0 for a stuck joint */
    double reaction[2]; /* N.m, N: of a stuck joint friction - rigid stop, else 0 */
};

void rp_plant_inertia(const struct rp_plant_parameters *p, bool attached, double q2,
                      struct rp_plant_inertia *inertia);

/* Kinetic energy with armature and payload, J. */
double rp_plant_kinetic_energy(const struct rp_plant_parameters *p, bool attached,
                               const double q[2], const double dq[2]);

/* b: all generalized forces but the reactions of stuck joints. A joint that slides has its
 * friction in it, a stuck one has none:
 *
 *   b = tau + Q - damping q' - friction + compliant stop - C q' - g */
void rp_plant_forces(const struct rp_plant_parameters *p, const struct rp_plant_modes *modes,
                     const double q[2], const double dq[2], const struct rp_plant_inputs *inputs,
                     double forces[2]);

void rp_plant_motion(const struct rp_plant_parameters *p, const struct rp_plant_modes *modes,
                     const double q[2], const double dq[2], const struct rp_plant_inputs *inputs,
                     struct rp_plant_motion *motion);
