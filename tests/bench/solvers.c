#include "bench.h"
#include "fmu3_library.h"
#include "fmu_library.h"
#include "rp_equations.h"

#include <malloc.h>
#include <math.h>
#include <string.h>
#include <sundials/sundials_config.h>
#ifdef BENCH_MUJOCO_MODEL
#include <mujoco/mujoco.h>
#endif

static const struct arm_parameters parameters = { // start values of the FMU
    .m1 = 2.0, .m2 = 1.0, .I1z = 0.1, .I2z = 0.05, .l1 = 0.5, .lc1 = 0.25, .a = 0.1, .g = 9.81};

static void arm(const double x[4], const double u[2], double dx[4]) {
    dx[0] = x[2];
    dx[1] = x[3];
    arm_accelerations(&parameters, x, x + 2, u, dx + 2);
}

/* ---- A loop of CVODE: restarts where inputs change */

static int rhs(sunrealtype t, N_Vector x, N_Vector dx, void *u) {
    arm(N_VGetArrayPointer(x), u, N_VGetArrayPointer(dx));
    return 0;
}

static double run_plain_loop(struct task *task) {
    double x[4];
    memcpy(x, task->start, sizeof x);
    const struct loop loop = {.rhs = rhs,
                              .n = 4,
                              .tolerance = task->tolerance,
                              .step = task->step,
                              .steps = task->steps,
                              .input_count = 2,
                              .inputs = task->inputs[0],
                              .restarts = task->changes,
                              .states = task->states[0]};
    return loop_run(&loop, x);
}

/* ---- FMI 2.0 */

static void log_text(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                     fmi2String category, fmi2String text, ...) {
    fprintf(stderr, "bench: %s\n", text);
}

static fmi2Component start2(const struct task *task) {
    static const fmi2CallbackFunctions callbacks = {.logger = log_text};
    const struct fmu *fmu = task->fmu;
    const struct fmu_functions *fmi = fmu->functions;
    fmi2Component c = fmi->Instantiate("bench", fmi2CoSimulation, fmu->token, "", &callbacks, 0, 0);
    require(c != NULL, "not instantiated");
    const size_t reals = (size_t)fmu->real_count, choices = (size_t)fmu->choice_count;
    require(fmi->SetReal(c, fmu->states, 4, task->start) == fmi2OK &&
                fmi->SetReal(c, fmu->reals, reals, fmu->real_values) == fmi2OK &&
                fmi->SetInteger(c, fmu->choices, choices, fmu->choice_values) == fmi2OK &&
                fmi->SetupExperiment(c, 1, task->tolerance, 0.0, 0, 0.0) == fmi2OK &&
                fmi->EnterInitializationMode(c) == fmi2OK &&
                fmi->ExitInitializationMode(c) == fmi2OK,
            "not initialized");
    return c;
}

/* fmi2SetReal, fmi2DoStep and fmi2GetReal of step i. */
static void step2(const struct task *task, fmi2Component c, int i) {
    const struct fmu *fmu = task->fmu;
    const struct fmu_functions *fmi = fmu->functions;
    const bool done = fmi->SetReal(c, fmu->inputs, 2, task->inputs[i]) == fmi2OK &&
                      fmi->DoStep(c, task->step * i, task->step, 1) == fmi2OK &&
                      fmi->GetReal(c, fmu->states, 4, task->states[i]) == fmi2OK;
    require(done, "a step failed");
}

static void keep_totals(struct task *task, const int totals[3]) {
    for (int i = 0; i < task->fmu->total_count; i++) {
        task->totals[i] = totals[i];
    }
}

static double run_fmu2(struct task *task) {
    const struct fmu *fmu = task->fmu;
    const struct fmu_functions *fmi = fmu->functions;
    fmi2Component c = start2(task);
    const double begin = processor_time();
    for (int i = 0; i < task->steps; i++) {
        step2(task, c, i);
    }
    const double seconds = processor_time() - begin;
    const size_t count = (size_t)fmu->total_count;
    int totals[3];
    require(fmi->GetInteger(c, fmu->totals, count, totals) == fmi2OK &&
                fmi->GetReal(c, &fmu->effective_tolerance, 1, &task->effective_tolerance) == fmi2OK,
            "no counts");
    keep_totals(task, totals);
    fmi->FreeInstance(c);
    return seconds;
}

/* ---- FMI 3.0, with neither event mode nor intermediate updates */

static void log_text3(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                      fmi3String text) {
    fprintf(stderr, "bench: %s\n", text);
}

static fmi3Instance start3(const struct task *task) {
    const struct fmu *fmu = task->fmu;
    const struct fmu3_functions *fmi = fmu->functions;
    fmi3Instance c = fmi->InstantiateCoSimulation("bench", fmu->token, "", false, false, false,
                                                  false, NULL, 0, NULL, log_text3, NULL);
    require(c != NULL, "not instantiated");
    require(fmi->SetFloat64(c, fmu->states, 4, task->start, 4) == fmi3OK, "no start");
    for (int i = 0; i < fmu->choice_count; i++) {
        const fmi3Int64 choice = fmu->choice_values[i];
        require(fmi->SetInt64(c, &fmu->choices[i], 1, &choice, 1) == fmi3OK, "a choice is refused");
    }
    require(fmi->EnterInitializationMode(c, true, task->tolerance, 0.0, false, 0.0) == fmi3OK &&
                fmi->ExitInitializationMode(c) == fmi3OK,
            "not initialized");
    return c;
}

/* fmi3SetFloat64, fmi3DoStep and fmi3GetFloat64 of step i. */
static void step3(const struct task *task, fmi3Instance c, int i) {
    const struct fmu *fmu = task->fmu;
    const struct fmu3_functions *fmi = fmu->functions;
    bool event;
    bool terminate;
    bool early;
    double reached;
    const bool done = fmi->SetFloat64(c, fmu->inputs, 2, task->inputs[i], 2) == fmi3OK &&
                      fmi->DoStep(c, task->step * i, task->step, true, &event, &terminate, &early,
                                  &reached) == fmi3OK &&
                      fmi->GetFloat64(c, fmu->states, 4, task->states[i], 4) == fmi3OK;
    require(done && !event && !terminate && !early, "a step failed");
}

static double run_fmu3(struct task *task) {
    const struct fmu *fmu = task->fmu;
    const struct fmu3_functions *fmi = fmu->functions;
    fmi3Instance c = start3(task);
    const double begin = processor_time();
    for (int i = 0; i < task->steps; i++) {
        step3(task, c, i);
    }
    const double seconds = processor_time() - begin;
    const size_t count = (size_t)fmu->total_count;
    fmi3Int32 totals[3];
    require(fmi->GetInt32(c, fmu->totals, count, totals, count) == fmi3OK &&
                fmi->GetFloat64(c, &fmu->effective_tolerance, 1, &task->effective_tolerance, 1) ==
                    fmi3OK,
            "no counts");
    keep_totals(task, totals);
    fmi->FreeInstance(c);
    return seconds;
}

void *bench_open(const char *path, int version) {
    const bool is_2 = version == 2;
    void *functions =
        calloc(1, is_2 ? sizeof(struct fmu_functions) : sizeof(struct fmu3_functions));
    require(functions != NULL, "no memory");
    const void *opened =
        is_2 ? fmu_library_open(path, functions) : fmu3_library_open(path, functions);
    require(opened != NULL, "the FMU cannot be loaded");
    return functions;
}

/* ---- MuJoCo on tests/rp_manipulator/rp_manipulator.xml: sets qfrc_applied, makes substeps, reads
 * qpos and qvel */

#ifdef BENCH_MUJOCO_MODEL

const char *bench_mujoco_version(void) {
    return mj_versionString();
}

static double run_mujoco(struct task *task) {
    char message[500] = "";
    mjModel *model = mj_loadXML(BENCH_MUJOCO_MODEL, NULL, message, sizeof message);
    require(model != NULL, message);
    model->opt.timestep = task->step / task->substeps;
    model->opt.integrator = task->solver == MUJOCO_RK4 ? mjINT_RK4 : mjINT_IMPLICITFAST;
    mjData *data = mj_makeData(model);
    require(data != NULL, "MuJoCo has no memory");
    memcpy(data->qpos, task->start, 2 * sizeof(double));
    memcpy(data->qvel, task->start + 2, 2 * sizeof(double));
    const double begin = processor_time();
    for (int i = 0; i < task->steps; i++) {
        memcpy(data->qfrc_applied, task->inputs[i], 2 * sizeof(double));
        for (int substep = 0; substep < task->substeps; substep++) {
            mj_step(model, data);
        }
        memcpy(task->states[i], data->qpos, 2 * sizeof(double));
        memcpy(task->states[i] + 2, data->qvel, 2 * sizeof(double));
    }
    const double seconds = processor_time() - begin;
    mj_deleteData(data);
    mj_deleteModel(model);
    return seconds;
}

#else

const char *bench_mujoco_version(void) {
    return "";
}

static double run_mujoco(struct task *task) {
    require(false, "built without MuJoCo");
    return 0.0;
}

#endif

/* ---- All */

#ifdef __clang__
#define COMPILER "clang " __clang_version__
#else
#define COMPILER "gcc " __VERSION__
#endif

const char *bench_made_by(void) {
    return COMPILER ", SUNDIALS " SUNDIALS_VERSION;
}

/* s between two readings of the clock in a row. */
static double clock_cost(void) {
    double least = 1.0;
    for (int i = 0; i < 1000; i++) {
        const double begin = processor_time();
        least = fmin(least, processor_time() - begin);
    }
    return least;
}

double bench_run(struct task *task, int passes) {
    static double (*const solvers[])(struct task *) = {[PLAIN_LOOP] = run_plain_loop,
                                                       [FMU2] = run_fmu2,
                                                       [FMU3] = run_fmu3,
                                                       [MUJOCO_RK4] = run_mujoco,
                                                       [MUJOCO_IMPLICITFAST] = run_mujoco};
    const double clock = clock_cost();
    double seconds = 0.0;
    for (int pass = 0; pass < passes; pass++) {
        seconds += solvers[task->solver](task) - clock;
    }
    return seconds / passes / task->steps;
}

double bench_life(struct task *task, int lives, double *kib) {
    const struct fmu_functions *fmi = task->fmu->functions;
    const double begin = processor_time();
    for (int life = 0; life < lives; life++) {
        fmi->FreeInstance(start2(task));
    }
    const double seconds = (processor_time() - begin) / lives;
    const size_t before = mallinfo2().uordblks;
    fmi2Component c = start2(task);
    step2(task, c, 0);
    *kib = (double)(mallinfo2().uordblks - before) / 1024.0;
    fmi->FreeInstance(c);
    return seconds;
}
