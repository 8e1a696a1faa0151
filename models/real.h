/* The number of the equations, which are plain C.
 *
 * Compiled as they stand they give values. The build reads the same text and derives from it what
 * else is needed: Jacobians, and derivatives along a curve. README.md says which C it understands.
 */
#pragma once

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

/* Carries derivatives where the build derives them. */
typedef double real;

/* The number without derivatives, for decisions and for factors that are taken as constant. */
static inline double value_of(real x) {
    return x;
}

/* The value of x with the derivatives of y, for two that are the same but for rounding. */
static inline real moving_as(real x, real y) {
    (void)y;
    return x;
}
