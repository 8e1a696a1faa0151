/* Starts Adams' method of CVODE with several orders at once. */
#pragma once

#include "method.h"

/* Prepares the first step of a solver that has been restarted at the time 0 with the state x: by
 * the Taylor series of the solution its order is above 1, and so is its length. row: room for the
 * series. Returns the length, s; 0 if it has done nothing. */
MUST_CHECK NONNULL double cvode_start(void *solver, struct problem *problem, const double x[],
                                      double row[][SERIES_LENGTH]);
