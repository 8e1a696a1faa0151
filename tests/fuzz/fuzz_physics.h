/* What physics says of the values of RPManipulator. A violation is a finding. */
#ifndef FUZZ_PHYSICS_H
#define FUZZ_PHYSICS_H

#include "fuzz_instance.h"
#include "value_references.h"

/* The loads that drive the joints are the same by Newton-Euler and by Euler-Lagrange (the left side
 * of (13) in the notes), but for the rounding of the terms of both; where the inputs were held they
 * are the inputs. */
void fuzz_check_newton_euler(const struct fuzz_values *values, bool inputs_are_held);

/* |dE - work| <= 1000 tolerance (max(|K| + |P|) + integral of |power|) over a step of this length
 * (s) with held inputs, plus what the integrator's own error test lets pass (README.md). saved: the
 * state before the step; the instance, which is after it, repeats the step in parts if the values
 * at its ends do not decide, and is brought back. */
void fuzz_check_energy(struct fuzz_instance *instance, fmi2FMUstate saved, double tolerance,
                       double length, const struct fuzz_values *before,
                       const struct fuzz_values *after);

#endif
