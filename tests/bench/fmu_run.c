#include "solvers.h"
#include "value_references.h"

#include <stdio.h>

const char *const method_names[METHODS] = {
    [CVODE_ADAMS] = "cvode_adams", [CVODE_BDF] = "cvode_bdf", [ERK] = "erk", [TAYLOR] = "taylor"};

/* Value references are the same type and number in both versions. */
static const unsigned states_of[] = {RP_MANIPULATOR_q1, RP_MANIPULATOR_q2, RP_MANIPULATOR_dq1,
                                     RP_MANIPULATOR_dq2};
static const unsigned inputs_of[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2};
static const unsigned solver_method = RP_MANIPULATOR_solver_method;
static const unsigned totals_of[] = {RP_MANIPULATOR_solver_steps,
                                     RP_MANIPULATOR_solver_rhs_evaluations};
static const unsigned effective = RP_MANIPULATOR_effective_relative_tolerance;

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
    const int chosen = (int)method;
    fmi2Component c = fmu_instantiate(fmu, fmu_guid_of_arm);
    require(fmu->SetReal(c, states_of, 4, problem->start) == fmi2OK &&
                fmu->SetInteger(c, &solver_method, 1, &chosen) == fmi2OK &&
                fmu->SetupExperiment(c, 1, tolerance, 0.0, 0, 0.0) == fmi2OK &&
                fmu->EnterInitializationMode(c) == fmi2OK &&
                fmu->ExitInitializationMode(c) == fmi2OK,
            "not initialized");
    return c;
}

void fmu_step(const struct fmu_functions *fmu, fmi2Component c, const struct problem *problem,
              int i, double x[4]) {
    const bool done = fmu->SetReal(c, inputs_of, 2, problem->inputs[i]) == fmi2OK &&
                      fmu->DoStep(c, problem->step * i, problem->step, 1) == fmi2OK &&
                      fmu->GetReal(c, states_of, 4, x) == fmi2OK;
    require(done, "a step failed");
}

double fmu_run(const struct fmu_functions *fmu, const struct problem *problem, enum method method,
               double tolerance, double states[][4], struct fmu_counts *counts) {
    fmi2Component c = fmu_start(fmu, problem, method, tolerance);
    const double begin = processor_time();
    for (int i = 0; i < problem->steps; i++) {
        fmu_step(fmu, c, problem, i, states[i]);
    }
    const double elapsed = processor_time() - begin;
    int total[2];
    require(fmu->GetInteger(c, totals_of, 2, total) == fmi2OK &&
                fmu->GetReal(c, &effective, 1, &counts->effective_tolerance) == fmi2OK,
            "no counts");
    counts->internal_steps = (double)total[0] / problem->steps;
    counts->evaluations = (double)total[1] / problem->steps;
    fmu->FreeInstance(c);
    return elapsed;
}

/* ---- FMI 3.0 */

static void log_text3(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                      fmi3String text) {
    (void)environment;
    (void)status;
    (void)category;
    fprintf(stderr, "bench: %s\n", text);
}

static fmi3Instance start3(const struct fmu3_functions *fmu, const struct problem *problem,
                           enum method method, double tolerance) {
    const fmi3Int64 chosen = method;
    fmi3Instance c =
        fmu->InstantiateCoSimulation("bench", RP_MANIPULATOR_TOKEN_FMI3, "", false, false, false,
                                     false, NULL, 0, NULL, log_text3, NULL);
    require(c != NULL, "not instantiated");
    require(fmu->SetFloat64(c, states_of, 4, problem->start, 4) == fmi3OK &&
                fmu->SetInt64(c, &solver_method, 1, &chosen, 1) == fmi3OK &&
                fmu->EnterInitializationMode(c, true, tolerance, 0.0, false, 0.0) == fmi3OK &&
                fmu->ExitInitializationMode(c) == fmi3OK,
            "not initialized");
    return c;
}

/* fmi3SetFloat64, fmi3DoStep and fmi3GetFloat64 of step i. */
static void step3(const struct fmu3_functions *fmu, fmi3Instance c, const struct problem *problem,
                  int i, double x[4]) {
    bool event;
    bool terminate;
    bool early;
    double reached;
    const bool done = fmu->SetFloat64(c, inputs_of, 2, problem->inputs[i], 2) == fmi3OK &&
                      fmu->DoStep(c, problem->step * i, problem->step, true, &event, &terminate,
                                  &early, &reached) == fmi3OK &&
                      fmu->GetFloat64(c, states_of, 4, x, 4) == fmi3OK;
    require(done && !event && !terminate && !early, "a step failed");
}

double fmu3_run(const struct fmu3_functions *fmu, const struct problem *problem, enum method method,
                double tolerance, double states[][4], struct fmu_counts *counts) {
    fmi3Instance c = start3(fmu, problem, method, tolerance);
    const double begin = processor_time();
    for (int i = 0; i < problem->steps; i++) {
        step3(fmu, c, problem, i, states[i]);
    }
    const double elapsed = processor_time() - begin;
    fmi3Int32 total[2];
    require(fmu->GetInt32(c, totals_of, 2, total, 2) == fmi3OK &&
                fmu->GetFloat64(c, &effective, 1, &counts->effective_tolerance, 1) == fmi3OK,
            "no counts");
    counts->internal_steps = (double)total[0] / problem->steps;
    counts->evaluations = (double)total[1] / problem->steps;
    fmu->FreeInstance(c);
    return elapsed;
}
