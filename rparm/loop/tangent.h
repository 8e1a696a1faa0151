/* A small deviation of an FMU's states, carried along by directional derivatives.
 *
 * The exponent of its growth is Lyapunov's over a finite time. At an event the deviation may jump,
 * which derivatives do not see: a step in which a discrete output changes has the growth NaN. */
#pragma once

#include "fmu_calls.h"

struct tangent {
    int64_t count; /* of states */
    const uint32_t *derivatives;
    const uint32_t *states;
    double *deviation;  /* [count] of length 1 */
    double *rate;       /* [count] at the beginning of the step */
    double *predicted;  /* [count] */
    int64_t real_count; /* discrete outputs */
    const uint32_t *reals;
    double *real_values; /* [2][real_count] now and before */
    int64_t integer_count;
    const uint32_t *integers;
    int64_t *integer_values; /* [integer_count] */
    int64_t has_begun;       /* 0: discrete outputs are read first, at the start of a run */
};

/* Notes the deviation's rate at the beginning of a step, inputs set. Returns a status. */
int tangent_begin(struct tangent *tangent, struct fmu *fmu);

/* Moves the deviation over a step of a length (s) by Heun's method, and writes the factor by which
 * it has grown. Returns a status. */
int tangent_end(struct tangent *tangent, struct fmu *fmu, double length, double *growth);
