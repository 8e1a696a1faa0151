/* A mass on a spring, x'' = -omega^2 x + gain u: the smallest model, without the generator. */
#ifndef OSCILLATOR_H
#define OSCILLATOR_H

#include "model.h"

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

#endif
