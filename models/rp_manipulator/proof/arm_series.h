/* Taylor coefficients in balls: of efforts and of the arm's motion, with its derivatives along the
 * variables at the origin. */
#ifndef ARM_SERIES_H
#define ARM_SERIES_H

#include "ball.h"

enum {
    STATES = 4,                      /* q1, q2, q1', q2' */
    PARAMETERS = 8,                  /* m1, m2, I1z, I2z, l1, lc1, a, g */
    VARIABLES = STATES + PARAMETERS, /* in this order */
    EFFORTS = 2,                     /* tau1, f2 */
    LAST_ORDER = 31,
    ORDERS = LAST_ORDER + 1,
    ARM_ROWS = 8,
    SINES = 8
};

struct sine {
    double amplitude, frequency, phase; /* amplitude sin(2 pi frequency t + phase); Hz, rad */
};

/* A cubic of the time since the begin of a communication step plus sines of the time since the
 * start. */
struct effort {
    double derivatives[4]; /* at the begin: value, per s, per s2, per s3 */
    int sine_count;
    struct sine sines[SINES];
};

/* A value and its derivatives along the first n variables. */
struct jet {
    int n;
    struct ball of[1 + VARIABLES];
};

/* Coefficients of order k are those of t^k times (the step)^k. */
struct arm_series {
    int directions;
    struct ball row[ARM_ROWS][1 + VARIABLES][ORDERS]; /* the states, then what they determine */
    struct jet a, g, per_m2, offset, per_inertia;
};

/* All orders of an effort at a time, or over all times of a ball. within, elapsed (s): time
 * since the begin of the communication step, and since the start. */
void effort_series(const struct effort *effort, struct ball within, struct ball elapsed,
                   struct ball step, struct ball coefficients[ORDERS]);

/* Order 0 of the motion, with derivatives along the first `directions` variables. */
void arm_series_begin(struct arm_series *series, const struct ball variables[VARIABLES],
                      int directions);

/* The next order of the motion, from 1 on. efforts: coefficients of tau1 and f2. */
void arm_series_extend(struct arm_series *series, struct ball step,
                       struct ball efforts[EFFORTS][ORDERS], int order);

#endif
