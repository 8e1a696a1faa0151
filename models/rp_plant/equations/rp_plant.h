/* Equations of the plant: the RP manipulator (rp_manipulator.h) with what a real one has: armature
 * and damping of its drives, dry friction, stops, a wrench at its end effector, a payload.
 *
 *   D q'' + C q' + g = tau + Q - damping q' - friction + stop                     (N.m, N)
 *
 * Frames, joints and symbols are those of rp_manipulator.h; arrays have one element per joint: rad,
 * rad/s, N.m of joint 1 and m, m/s, N of joint 2. Each feature is off while its parameters are 0
 * or none; with all off the results are those of the manipulator bit for bit, up to the sign of
 * zero.
 *
 * The equations are in rp_plant_equations.h; the functions here call them and leave out what is 0.
 * All functions are pure and allocate nothing. */
#pragma once

#include "rp_manipulator.h"

enum rp_plant_stops {
    RP_PLANT_STOPS_NONE = 1,
    RP_PLANT_STOPS_RIGID = 2,
    RP_PLANT_STOPS_COMPLIANT = 3,
};

/* What happens to the velocities when the payload is grasped. */
enum rp_plant_grasp {
    RP_PLANT_KEEP_VELOCITY = 1, /* the payload already moves with the end effector */
    RP_PLANT_AT_REST = 2,       /* the payload rests: a plastic impact */
};

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

struct rp_plant_parameters {
    struct arm_parameters arm;
    double armature[2];           /* kg.m2, kg, >= 0: inertia of the drive, seen at the joint */
    double damping[2];            /* N.m.s/rad, N.s/m, >= 0 */
    double coulomb_friction[2];   /* N.m, N, >= 0: of a fast joint */
    double breakaway_friction[2]; /* N.m, N: of a joint at rest; 0: as coulomb_friction, else not
                                     below it */
    double stribeck_velocity[2];  /* rad/s, m/s, >= 0: how fast friction falls with the velocity;
                                     above 0 where breakaway_friction is above coulomb_friction */
    double lower[2];              /* rad, m: where the stops are */
    double upper[2];              /* rad, m, > lower */
    double restitution[2];        /* 0 .. 1: ratio of the velocities after and before */
    double payload_mass;          /* kg, >= 0 */
    double payload_inertia;       /* kg.m2, >= 0: about its center of mass, along z0 */
    double payload_x;             /* m: its center of mass in frame 2, along x2 */
    double payload_z;             /* m: the same, along z2 (the slide) */
    double stop_stiffness[2];     /* N.m/rad, N/m, > 0: of compliant stops */
    double stop_damping[2];       /* s/rad, s/m, >= 0: of compliant stops, by Hunt and Crossley */
    int stops[2];                 /* enum rp_plant_stops */
    int grasp;                    /* enum rp_plant_grasp */
};

struct rp_plant_inputs {
    double tau[2];    /* N.m, N: efforts of the drives */
    double wrench[3]; /* N, N, N.m: force along x0 and y0 and moment about z0 that act on link 2 at
                         the end effector, the origin of frame 2 */
};

struct rp_plant_modes {
    int joint[2];   /* enum rp_plant_joint_mode */
    int payload;    /* enum rp_plant_payload_mode */
    int contact[2]; /* enum rp_plant_contact, times the side */
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

/* Time derivatives of the reactions along the motion in these modes, the inputs changing at the
 * rates du. */
void rp_plant_reaction_rates(const struct rp_plant_parameters *p,
                             const struct rp_plant_modes *modes, const double q[2],
                             const double dq[2], const struct rp_plant_inputs *inputs,
                             const struct rp_plant_inputs *du, double rates[2]);
