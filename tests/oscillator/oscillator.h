/* The oscillator for tests in C: its generated headers, and its solution. */
#ifndef OSCILLATOR_H
#define OSCILLATOR_H

#include "equations.h"
#include "model_description.h"
#include "value_references.h"

#include <math.h>

/* State at time t after start with omega and u held; start and end may be the same array. */
static inline void oscillator_solution(double omega, double u, double t, const double start[2],
                                       double end[2]) {
    const double rest = u / (omega * omega);
    const double c = cos(omega * t);
    const double s = sin(omega * t);
    const double x = rest + (start[0] - rest) * c + start[1] / omega * s;
    const double v = -(start[0] - rest) * omega * s + start[1] * c;
    end[0] = x;
    end[1] = v;
}

#endif
