/* The Taylor series of the arm's motion. */
#pragma once

#include "model.h"
#include "rp_manipulator.h"

/* The states q1, q2, q1', q2', then l1 + q2, (l1 + q2) q1', sin q1, cos q1. */
enum { RP_SERIES_ROWS = 8 };

/* Writes coefficients as extend of struct series does, with inputs tau1, f2. friction:
 * constant efforts (N.m, N) against the inputs; NULL: none. */
void rp_series_extend(const struct arm_parameters *parameters, const double friction[2],
                      const struct series_origin *origin, int first, int last,
                      double row[][SERIES_LENGTH]);
