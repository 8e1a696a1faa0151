#include "fmu_run.h"

#include "measure.h"
#include "value_references.h"

#include <stdio.h>

const char *const method_names[METHODS] = {
    [CVODE_ADAMS] = "cvode_adams", [CVODE_BDF] = "cvode_bdf", [ERK] = "erk", [TAYLOR] = "taylor"};

static const fmi2ValueReference states_of[] = {RP_MANIPULATOR_q1, RP_MANIPULATOR_q2,
                                               RP_MANIPULATOR_dq1, RP_MANIPULATOR_dq2};
static const fmi2ValueReference inputs_of[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2};

static void log_text(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                     fmi2String category, fmi2String text, ...) {
    fprintf(stderr, "bench: %s\n", text);
}

static const fmi2CallbackFunctions callbacks = {.logger = log_text};

const char fmu_guid_of_arm[] = RP_MANIPULATOR_GUID;

fmi2Component fmu_instantiate(const struct fmu_functions *fmu, const char *guid) {
    fmi2Component c = fmu->Instantiate("bench", fmi2CoSimulation, guid, "", &callbacks, 0, 0);
    require(c != NULL, "not instantiated");
    return c;
}

fmi2Component fmu_start(const struct fmu_functions *fmu, const struct problem *problem,
                        enum method method, double tolerance) {
    static const fmi2ValueReference solver_method = RP_MANIPULATOR_solver_method;
    static const fmi2ValueReference g = RP_MANIPULATOR_g;
    const int chosen = (int)method;
    fmi2Component c = fmu_instantiate(fmu, fmu_guid_of_arm);
    require(fmu->SetReal(c, states_of, 4, problem->start) == fmi2OK &&
                fmu->SetReal(c, &g, 1, &problem->g) == fmi2OK &&
                fmu->SetInteger(c, &solver_method, 1, &chosen) == fmi2OK &&
                fmu->SetupExperiment(c, 1, tolerance, 0.0, 0, 0.0) == fmi2OK &&
                fmu->EnterInitializationMode(c) == fmi2OK &&
                fmu->ExitInitializationMode(c) == fmi2OK,
            "not initialized");
    return c;
}

fmi2Status fmu_set_inputs(const struct fmu_functions *fmu, fmi2Component c, const double u[2]) {
    return fmu->SetReal(c, inputs_of, 2, u);
}

fmi2Status fmu_get_states(const struct fmu_functions *fmu, fmi2Component c, double x[4]) {
    return fmu->GetReal(c, states_of, 4, x);
}

void fmu_step(const struct fmu_functions *fmu, fmi2Component c, const struct problem *problem,
              int i, double x[4]) {
    const bool done = fmu_set_inputs(fmu, c, problem->inputs[i]) == fmi2OK &&
                      fmu->DoStep(c, problem->step * i, problem->step, 1) == fmi2OK &&
                      fmu_get_states(fmu, c, x) == fmi2OK;
    require(done, "a step failed");
}

double fmu_run(const struct fmu_functions *fmu, const struct problem *problem, enum method method,
               double tolerance, double states[][4], struct fmu_counts *counts) {
    static const fmi2ValueReference totals[] = {RP_MANIPULATOR_solver_steps,
                                                RP_MANIPULATOR_solver_rhs_evaluations};
    static const fmi2ValueReference effective = RP_MANIPULATOR_effective_relative_tolerance;
    fmi2Component c = fmu_start(fmu, problem, method, tolerance);
    const double begin = processor_time();
    for (int i = 0; i < problem->steps; i++) {
        fmu_step(fmu, c, problem, i, states[i]);
    }
    const double elapsed = processor_time() - begin;
    int total[2];
    require(fmu->GetInteger(c, totals, 2, total) == fmi2OK &&
                fmu->GetReal(c, &effective, 1, &counts->effective_tolerance) == fmi2OK,
            "no counts");
    counts->internal_steps = (double)total[0] / problem->steps;
    counts->evaluations = (double)total[1] / problem->steps;
    fmu->FreeInstance(c);
    return elapsed;
}
