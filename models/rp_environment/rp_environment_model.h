/* A compliant wall that the arm can touch, as the instance runs it: its value structure, to which
 * variables.toml binds the variables, and its struct model. No states: all outputs are functions of
 * the inputs.
 *
 * Frames 0 and 2 are those of the arm: z2 is the direction of the slide, at ee_angle from x0; x2 is
 * a quarter turn ahead of it. */
#ifndef RP_ENVIRONMENT_MODEL_H
#define RP_ENVIRONMENT_MODEL_H

#include "model.h"

struct rp_environment_parameters {
    double stiffness; /* N/m, >= 0 */
    double damping;   /* N.s/m, >= 0 */
    double position;  /* m: of the surface along the outward normal, from the origin of frame 0 */
    double angle;     /* rad: direction of the outward normal, from x0 about z0 */
    double tip_x;     /* m: the point that touches, in frame 2 */
    double tip_z;     /* m */
};

/* The end effector, which is the origin of frame 2, in frame 0. */
struct rp_environment_inputs {
    double position[2]; /* m */
    double velocity[2]; /* m/s */
    double angle;       /* rad */
    double rate;        /* rad/s */
};

struct rp_environment_values {
    struct rp_environment_parameters parameters;
    struct rp_environment_inputs inputs;

    /* calculated from the above */
    double wrench[3];   /* N, N, N.m: on the arm, in frame 0, about the origin of frame 2 */
    double penetration; /* m, >= 0 */
    double force;       /* N, >= 0, along the outward normal */
};

/* propagate of struct model. Where the force sets in or ends, derivatives are those of the side
 * without force, all 0. */
enum status rp_environment_propagate(const void *values, double t, double dt, void *first,
                                     void *second);

extern const struct model rp_environment_model;

#endif
