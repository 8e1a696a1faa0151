/* Sets that contain the arm's states, and steps from one to the next. */
#ifndef STEP_H
#define STEP_H

#include "arm_series.h"

enum { SIDES = STATES + VARIABLES };

/* The states  centre + sum of c_j side_j  for all |c_j| <= radius_j. The first four sides are a
 * frame. The others are those of uncertain variables: their c_j are the same ones forever. */
struct states_set {
    struct ball centre[STATES]; /* without radii */
    int sides; /* how many there are: 4, and 4 or 12 where variables are uncertain */
    double side[SIDES][STATES];
    double radius[SIDES];
};

struct arm_problem {
    struct ball variables[VARIABLES]; /* at the start */
    int directions;                   /* 4, or 12 where parameters are uncertain */
};

/* A step, and what it claims. */
struct arm_step {
    struct ball length, within, elapsed; /* s: of the step, and when it begins */
    int more_orders; /* beyond those that matter for the centre: the box is wider */
    int order;
    struct ball hull[STATES];      /* contains the set at the begin */
    struct ball box[STATES];       /* contains all motions from there, over the whole step */
    struct ball remainder[STATES]; /* coefficient order + 1 of all motions from the box */
    struct ball endpoint[STATES];  /* the Taylor polynomial of the centre at the end */
    struct ball jacobian[STATES][VARIABLES]; /* its derivative, anywhere in the hull */
    double deviation;                        /* row sums of I - Q^T Q, of the frame after */
    struct states_set after;
};

/* The first set of a problem whose variables are there. */
void arm_start(struct arm_problem *problem, struct states_set *set);

/* Balls that contain a set. */
void states_hull(const struct states_set *set, struct ball hull[STATES]);

/* One step of the given length. False: a shorter one may go. `factor` gets by how much to change
 * the length next. */
bool arm_take_step(const struct arm_problem *problem, const struct states_set *before,
                   const struct effort efforts[EFFORTS], struct arm_step *step, double *factor);

/* Chooses an orthogonal frame, but for rounding, of the sides that a matrix gets. Any is good; a
 * set is small in a frame along its longest sides. */
void frame_along(struct ball sides[STATES][STATES], const double radius[STATES],
                 double frame[STATES][STATES]);

/* Coordinates of a set in a frame: bounds of |Q^-1 (sum of c_j side_j + z)| over all |c_j| <=
 * radius_j and |z_i| <= rest_i. Returns what bounds the row sums of I - Q^T Q; below 1, or the
 * coordinates are infinite. */
double frame_coordinates(double frame[STATES][STATES], struct ball sides[STATES][STATES],
                         const double radius[STATES], const double rest[STATES],
                         double coordinates[STATES]);

#endif
