/* Sets that contain the arm's states, and steps from one to the next. */
#ifndef STEP_H
#define STEP_H

#include "arm_series.h"
#include "effort.h"

/* The states  centre + spread s + frame c  for all |s_j| <= start_radii_j and |c_i| <= radii_i. The
 * coordinates s are those of uncertain starts and parameters: the same ones forever. */
struct states_set {
    struct ball centre[STATES]; /* without radii */
    int starts;                 /* how many coordinates s */
    double spread[STATES][DIRECTIONS];
    double frame[STATES][STATES];
    double radii[STATES];
};

/* What has its own coordinate s, and what is the same in all steps. */
struct arm_problem {
    struct ball states[STATES], parameters[PARAMETERS];
    int uncertain; /* parameters with a radius */
    int along[PARAMETERS];
    int starts;
    int direction[DIRECTIONS]; /* of coordinate s_j: a state, or STATES + an index into `along` */
    double start_radii[DIRECTIONS];
};

/* A step, and what it claims. */
struct arm_step {
    struct ball length, within, elapsed; /* s: of the step, and when it begins */
    int more_orders; /* beyond those that matter for the centre: the box is wider */
    int order;
    struct ball hull[STATES];      /* contains the set at the begin */
    struct ball box[STATES];       /* contains all motions from there, over the whole step */
    struct ball remainder[STATES]; /* coefficient order + 1 of all motions from the box, times
                                      length^(order + 1) */
    struct ball endpoint[STATES];  /* the Taylor polynomial of the centre at the end */
    struct ball jacobian[STATES]
                        [DIRECTIONS]; /* derivative of that polynomial, anywhere in the hull */
    double deviation;                 /* row sums of I - frame^T frame, of the frame after */
    struct states_set after;
};

enum arm_step_result {
    STEP_DONE,
    STEP_TOO_LONG, /* a shorter one may go */
};

/* Completes a problem whose states and parameters are there, and gives its first set. */
void arm_start(struct arm_problem *problem, struct states_set *set);

/* Balls that contain a set. */
void states_hull(const struct arm_problem *problem, const struct states_set *set,
                 struct ball hull[STATES]);

/* One step of the given length; `factor` gets by how much to change it next. */
enum arm_step_result arm_take_step(const struct arm_problem *problem,
                                   const struct states_set *before,
                                   const struct effort efforts[EFFORTS], struct arm_step *step,
                                   double *factor);

#endif
