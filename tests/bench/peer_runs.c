#include "solvers.h"

#ifdef BENCH_MUJOCO_MODEL
#include <mujoco/mujoco.h>
#endif
#include <string.h>

static int rhs(sunrealtype t, N_Vector x, N_Vector dx, void *u) {
    problem_rhs(N_VGetArrayPointer(x), u, N_VGetArrayPointer(dx));
    return 0;
}

double plain_loop_run(const struct problem *problem, double tolerance, double states[][4]) {
    double x[4];
    memcpy(x, problem->start, sizeof x);
    const bool restarts = problem->kind == INPUTS_CHANGING;
    const struct loop loop = {rhs,           NULL,           4, tolerance,          NULL,
                              problem->step, problem->steps, 2, problem->inputs[0], restarts,
                              states[0]};
    return loop_run(&loop, x);
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
