/* Taylor coefficients of the arm's motion in balls, and their derivatives with respect to the
 * states and parameters at the origin. */
#ifndef ARM_SERIES_H
#define ARM_SERIES_H

#include "ball.h"

enum {
    STATES = 4,     /* q1, q2, q1', q2' */
    PARAMETERS = 8, /* m1, m2, I1z, I2z, l1, lc1, a, g */
    EFFORTS = 2,    /* tau1, f2 */
    LAST_ORDER = 31,
    ORDERS = LAST_ORDER + 1,
    DIRECTIONS = STATES + PARAMETERS,
    ARM_ROWS = 8
};

/* A value and its derivatives in some directions. */
struct jet {
    struct ball of[1 + DIRECTIONS];
};

/* Where a series begins. */
struct arm_origin {
    struct ball states[STATES];
    struct ball parameters[PARAMETERS];
    int directions; /* 0: no derivatives; else first the states, then the parameters in `along` */
    int along[PARAMETERS];
};

/* Coefficients of order k are those of t^k times (the step)^k. */
struct arm_series {
    int directions;
    struct ball row[ARM_ROWS][1 + DIRECTIONS][ORDERS]; /* the states, then what they determine */
    struct jet m2, a, g, l1, m1_lc1, per_m2, fixed_inertia, per_inertia;
};

/* The coefficients of order 0. */
void arm_series_begin(struct arm_series *series, const struct arm_origin *origin);

/* Those of an order from 1 on; the orders before are there. efforts: coefficients of tau1 and f2.
 */
void arm_series_extend(struct arm_series *series, struct ball step,
                       struct ball efforts[EFFORTS][ORDERS], int order);

#endif
