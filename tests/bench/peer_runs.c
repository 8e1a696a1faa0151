#include "solvers.h"

#include <cvode/cvode.h>
#ifdef BENCH_MUJOCO_MODEL
#include <mujoco/mujoco.h>
#endif
#include <nvector/nvector_serial.h>
#include <string.h>
#include <sundials/sundials_context.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

static int rhs(sunrealtype t, N_Vector x, N_Vector dx, void *u) {
    (void)t;
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

/* ---- MuJoCo */

#ifdef BENCH_MUJOCO_MODEL

bool mujoco_available(void) {
    return true;
}

const char *mujoco_version(void) {
    return mj_versionString();
}

double mujoco_run(const struct problem *problem, enum mujoco_integrator integrator, int substeps,
                  double states[][4]) {
    char message[500] = "";
    mjModel *model = mj_loadXML(BENCH_MUJOCO_MODEL, NULL, message, sizeof message);
    require(model != NULL, message);
    model->opt.timestep = problem->step / substeps;
    model->opt.integrator = integrator == MUJOCO_RK4 ? mjINT_RK4 : mjINT_IMPLICITFAST;
    mjData *data = mj_makeData(model);
    require(data != NULL, "MuJoCo has no memory");
    for (int j = 0; j < 2; j++) {
        data->qpos[j] = problem->start[j];
        data->qvel[j] = problem->start[2 + j];
    }

    const double begin = processor_time();
    for (int i = 0; i < problem->steps; i++) {
        data->qfrc_applied[0] = problem->inputs[i][0];
        data->qfrc_applied[1] = problem->inputs[i][1];
        for (int substep = 0; substep < substeps; substep++) {
            mj_step(model, data);
        }
        for (int j = 0; j < 2; j++) {
            states[i][j] = data->qpos[j];
            states[i][2 + j] = data->qvel[j];
        }
    }
    const double elapsed = processor_time() - begin;

    mj_deleteData(data);
    mj_deleteModel(model);
    return elapsed;
}

#else

bool mujoco_available(void) {
    return false;
}

const char *mujoco_version(void) {
    return "";
}

double mujoco_run(const struct problem *problem, enum mujoco_integrator integrator, int substeps,
                  double states[][4]) {
    (void)problem;
    (void)integrator;
    (void)substeps;
    (void)states;
    require(false, "built without MuJoCo");
    return 0.0;
}

#endif
