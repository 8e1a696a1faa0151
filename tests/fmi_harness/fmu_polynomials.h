/* Inputs that are polynomials of time over a step, and instances to apply them to. */
#ifndef FMU_POLYNOMIALS_H
#define FMU_POLYNOMIALS_H

#include "fmu_harness.h"

/* Value and derivatives at the beginning of a step, per s^k. */
struct fmu_polynomial {
    double d[4];
};

/* Its integral of this order from 0 to s; 0: its value; negative: its derivative at s. */
double fmu_polynomial_integral(const struct fmu_polynomial *polynomial, int order, double s);

/* Sets the value of the input and those derivatives that are not 0. */
void fmu_set_polynomial(fmi2Component component, fmi2ValueReference reference,
                        const struct fmu_polynomial *polynomial);

/* A slide that is not coupled to the rotation: with a = 0 and g = 0, at rest in q1, q2'' = f2 /
 * fmu_slide_mass. Instantiated, from 0 m at rest; the experiment is set up and starts at start (s).
 */
fmi2Component fmu_slide(struct fmu_log *log, double start);
extern const double fmu_slide_mass; /* kg */

/* f2 with one order each, and with all at once (the last). */
enum { FMU_SLIDE_FORCES = 5 };
extern const struct fmu_polynomial fmu_slide_forces[FMU_SLIDE_FORCES];

/* Through initialization mode. */
void fmu_slide_begin(fmi2Component component);

/* The whole manipulator in motion, initialized at 0 s, and inputs that move it a lot in 0.25 s. */
fmi2Component fmu_swinging(struct fmu_log *log);
extern const struct fmu_polynomial fmu_torque;
extern const struct fmu_polynomial fmu_force;

#endif
