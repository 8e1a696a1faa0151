/* A mass on a spring, x'' = -omega^2 x + gain u: the smallest model, with a table of variables
 * written by hand, for the tests of src/, which must not depend on the generator; and its solution.
 */
#ifndef OSCILLATOR_BY_HAND_H
#define OSCILLATOR_BY_HAND_H

#include "instance.h"

struct oscillator_values {
    double omega; /* rad/s, tunable, > 0 together with damping */
    double gain;  /* fixed */
    double u;     /* m/s2 */
    double x;     /* m */
    double v;     /* m/s */
    double a;     /* m/s2, calculated */
    double energy;
};

extern const struct model oscillator_model;

enum oscillator_reference {
    OSCILLATOR_TIME = 0,
    OSCILLATOR_OMEGA = 1,
    OSCILLATOR_GAIN = 2,
    OSCILLATOR_X = 10,
    OSCILLATOR_V = 11,
    OSCILLATOR_U = 20,
    OSCILLATOR_ENERGY = 30,
    OSCILLATOR_A = 31,
    OSCILLATOR_STEPS = 80,
    OSCILLATOR_EVALUATIONS = 81,
    OSCILLATOR_RELATIVE_TOLERANCE = 82,
    OSCILLATOR_MAX_STEPS = 83,
    OSCILLATOR_EFFECTIVE_TOLERANCE = 84,
    OSCILLATOR_SOLVER_METHOD = 90,
    OSCILLATOR_MAX_STEP = 91,
};

extern const struct model_description oscillator_description;

/* State at time t after start with omega and u held; start and end may be the same array. */
void oscillator_solution(double omega, double u, double t, const double start[2], double end[2]);

#endif
