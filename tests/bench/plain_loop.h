/* The loop that a user of CVODE would write: CVodeReInit and CVode on N_Vector_Serial. */
#ifndef BENCH_PLAIN_LOOP_H
#define BENCH_PLAIN_LOOP_H

#include "problem.h"

/* Processor time of all steps, s. Restarts at every step where inputs change, else goes on
 * (CV_NORMAL, with CVODE's interpolation). */
double plain_loop_run(const struct problem *problem, double tolerance, double states[][4]);

#endif
