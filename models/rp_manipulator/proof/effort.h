/* An effort over a communication step: a cubic of the time since its begin, which may be constant,
 * plus sines of the time since the start. */
#ifndef EFFORT_H
#define EFFORT_H

#include "arm_series.h"

enum { SINES = 8 };

struct sine {
    double amplitude, frequency, phase; /* amplitude sin(2 pi frequency t + phase); Hz, rad */
};

struct effort {
    double
        derivatives[4]; /* at the begin of the communication step: value, per s, per s2, per s3 */
    int sine_count;
    struct sine sines[SINES];
};

/* Coefficients of t^k times step^k at a time, or over all times of a ball, for k = 0 .. last.
 * within, elapsed (s): time since the begin of the communication step, and since the start. */
void effort_series(const struct effort *effort, struct ball within, struct ball elapsed,
                   struct ball step, int last, struct ball coefficients[ORDERS]);

#endif
