/* The plant as the instance runs it: its value structure, to which variables.toml binds the
 * variables, and its struct model. */
#pragma once

#include "model.h"
#include "rp_plant.h"

enum { RP_PLANT_INDICATORS = 10 }; /* four of joint 1, four of joint 2; a fifth of each */

/* Sums over events since the start. */
struct rp_plant_sums {
    double stop_impulse[2]; /* N.m.s, N.s: of the impacts, on the joint */
    double impact_loss;     /* J */
    double grasp_loss;      /* J */
};

struct rp_plant_values {
    struct rp_plant_parameters parameters;
    struct rp_plant_inputs inputs;
    double q[2];   /* states: rad, m */
    double dq[2];  /* states: rad/s, m/s */
    double ddq[2]; /* calculated: rad/s2, m/s2 */

    int payload_attached;        /* discrete input: 0 or 1 */
    struct rp_plant_modes modes; /* written at events */
    struct rp_plant_sums sums;   /* written at events */

    /* calculated from the above */
    double ee_position[2];     /* m, frame 0 */
    double ee_velocity[2];     /* m/s, frame 0 */
    double ee_acceleration[2]; /* m/s2, frame 0 */
    double ee_angle;           /* rad, of the slide z2 from x0 */
    double ee_rate;            /* rad/s */
    double kinetic_energy;     /* J: energies include armature and an attached payload */
    double potential_energy;   /* with compliant stops */
    double total_energy;
    double actuator_power; /* W */
    double D[2][2];        /* with armature and an attached payload */
    double coriolis[2];    /* N.m, N */
    double gravity[2];     /* N.m, N */
    struct rp_joint_loads loads;
    double friction[2];    /* N.m, N: dry friction, positive against a forward motion */
    double friction_power; /* W: what dry friction and damping take */
    double stop_force[2];  /* N.m, N: of a stop on the joint, but impacts */
    double indicators[RP_PLANT_INDICATORS]; /* rad/s, m/s; N.m, N; rad, m; 1; 1: unused */
};

/* Events of the plant: a joint comes to rest, breaks away, reaches a stop; the payload is grasped
 * or released; an input or a parameter jumps (rp_plant_events.c). */
extern const struct model_events rp_plant_events;

/* The Taylor series of the motion in its modes (rp_plant_series.c): states q1, q2, q1', q2', inputs
 * tau1, f2 and the wrench. */
extern const struct series rp_plant_series;

/* reach of struct model_events (rp_plant_series.c). */
void rp_plant_reach(const void *values, const double x[], double reach[]);

extern const struct model rp_plant_model;
