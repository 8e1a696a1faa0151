#include "plain_loop.h"

#include "measure.h"

#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <string.h>
#include <sundials/sundials_context.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

static int rhs(sunrealtype t, N_Vector x, N_Vector dx, void *u) {
    problem_rhs(N_VGetArrayPointer(x), u, N_VGetArrayPointer(dx));
    return 0;
}

double plain_loop_run(const struct problem *problem, double tolerance, double states[][4]) {
    double u[2];
    SUNContext context;
    require(SUNContext_Create(NULL, &context) == 0, "no context");
    N_Vector x = N_VNew_Serial(4, context);
    N_Vector absolute = N_VNew_Serial(4, context);
    N_VConst(1e-2 * tolerance, absolute);
    memcpy(N_VGetArrayPointer(x), problem->start, sizeof problem->start);
    void *cvode = CVodeCreate(CV_ADAMS, context);
    SUNNonlinearSolver solver = SUNNonlinSol_FixedPoint(x, 0, context);
    require(CVodeInit(cvode, rhs, 0.0, x) == CV_SUCCESS &&
                CVodeSVtolerances(cvode, tolerance, absolute) == CV_SUCCESS &&
                CVodeSetUserData(cvode, u) == CV_SUCCESS &&
                CVodeSetMaxNumSteps(cvode, 100000) == CV_SUCCESS &&
                CVodeSetNonlinearSolver(cvode, solver) == CV_SUCCESS,
            "no CVODE");

    const double begin = processor_time();
    for (int i = 0; i < problem->steps; i++) {
        double reached;
        memcpy(u, problem->inputs[i], sizeof u);
        if (problem->kind == INPUTS_CHANGING) {
            CVodeReInit(cvode, problem->step * i, x);
        }
        require(CVode(cvode, problem->step * (i + 1), x, &reached, CV_NORMAL) == CV_SUCCESS,
                "CVode failed");
        memcpy(states[i], N_VGetArrayPointer(x), sizeof states[i]);
    }
    const double elapsed = processor_time() - begin;

    SUNNonlinSolFree(solver);
    CVodeFree(&cvode);
    N_VDestroy(absolute);
    N_VDestroy(x);
    SUNContext_Free(&context);
    return elapsed;
}
