#include "fmu3_run.h"

#include "measure.h"
#include "value_references.h"

#include <stdio.h>

static const fmi3ValueReference states_of[] = {RP_MANIPULATOR_q1, RP_MANIPULATOR_q2,
                                               RP_MANIPULATOR_dq1, RP_MANIPULATOR_dq2};
static const fmi3ValueReference inputs_of[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2};

static void log_text(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                     fmi3String text) {
    fprintf(stderr, "bench: %s\n", text);
}

static fmi3Instance start(const struct fmu3_functions *fmu, const struct problem *problem,
                          enum method method, double tolerance) {
    static const fmi3ValueReference solver_method = RP_MANIPULATOR_solver_method;
    static const fmi3ValueReference g = RP_MANIPULATOR_g;
    const fmi3Int64 chosen = method;
    fmi3Instance c =
        fmu->InstantiateCoSimulation("bench", RP_MANIPULATOR_TOKEN_FMI3, "", false, false, false,
                                     false, NULL, 0, NULL, log_text, NULL);
    require(c != NULL, "not instantiated");
    require(fmu->SetFloat64(c, states_of, 4, problem->start, 4) == fmi3OK &&
                fmu->SetFloat64(c, &g, 1, &problem->g, 1) == fmi3OK &&
                fmu->SetInt64(c, &solver_method, 1, &chosen, 1) == fmi3OK &&
                fmu->EnterInitializationMode(c, true, tolerance, 0.0, false, 0.0) == fmi3OK &&
                fmu->ExitInitializationMode(c) == fmi3OK,
            "not initialized");
    return c;
}

/* fmi3SetFloat64, fmi3DoStep and fmi3GetFloat64 of step i. */
static void step(const struct fmu3_functions *fmu, fmi3Instance c, const struct problem *problem,
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
    static const fmi3ValueReference totals[] = {RP_MANIPULATOR_solver_steps,
                                                RP_MANIPULATOR_solver_rhs_evaluations};
    static const fmi3ValueReference effective = RP_MANIPULATOR_effective_relative_tolerance;
    fmi3Instance c = start(fmu, problem, method, tolerance);
    const double begin = processor_time();
    for (int i = 0; i < problem->steps; i++) {
        step(fmu, c, problem, i, states[i]);
    }
    const double elapsed = processor_time() - begin;
    fmi3Int32 total[2];
    require(fmu->GetInt32(c, totals, 2, total, 2) == fmi3OK &&
                fmu->GetFloat64(c, &effective, 1, &counts->effective_tolerance, 1) == fmi3OK,
            "no counts");
    counts->internal_steps = (double)total[0] / problem->steps;
    counts->evaluations = (double)total[1] / problem->steps;
    fmu->FreeInstance(c);
    return elapsed;
}
