/* The FMU through its own functions, as an importer calls it. */
#ifndef BENCH_FMU_RUN_H
#define BENCH_FMU_RUN_H

#include "fmu_library.h"
#include "problem.h"

/* The items of solver_method. */
enum method { CVODE_ADAMS = 1, FIRST_METHOD = CVODE_ADAMS, CVODE_BDF, ERK, TAYLOR, METHODS };
extern const char *const method_names[METHODS];

struct fmu_counts {
    double effective_tolerance;
    double internal_steps; /* per communication step */
    double evaluations;    /* of the right-hand side, per communication step */
};

/* An instance of the FMU with this GUID. */
fmi2Component fmu_instantiate(const struct fmu_functions *fmu, const char *guid);
extern const char fmu_guid_of_arm[];

/* An initialized instance at the problem's start. */
fmi2Component fmu_start(const struct fmu_functions *fmu, const struct problem *problem,
                        enum method method, double tolerance);

/* Two of the three calls of a communication step; the third is fmi2DoStep. */
fmi2Status fmu_set_inputs(const struct fmu_functions *fmu, fmi2Component c, const double u[2]);
fmi2Status fmu_get_states(const struct fmu_functions *fmu, fmi2Component c, double x[4]);

/* fmi2SetReal, fmi2DoStep and fmi2GetReal of step i. */
void fmu_step(const struct fmu_functions *fmu, fmi2Component c, const struct problem *problem,
              int i, double x[4]);

/* Processor time of all steps, s. */
double fmu_run(const struct fmu_functions *fmu, const struct problem *problem, enum method method,
               double tolerance, double states[][4], struct fmu_counts *counts);

#endif
