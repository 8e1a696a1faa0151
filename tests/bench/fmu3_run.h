/* The same work through the functions of FMI 3.0. */
#ifndef BENCH_FMU3_RUN_H
#define BENCH_FMU3_RUN_H

#include "fmu3_library.h"
#include "fmu_run.h"

/* As fmu_run; the instance has neither event mode nor intermediate updates. */
double fmu3_run(const struct fmu3_functions *fmu, const struct problem *problem, enum method method,
                double tolerance, double states[][4], struct fmu_counts *counts);

#endif
