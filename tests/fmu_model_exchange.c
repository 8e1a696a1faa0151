#include "fmu_model_exchange.h"

#include <string.h>
#include <unity.h>

static fmi2Status worse(fmi2Status a, fmi2Status b) {
    return a > b ? a : b;
}

fmi2Status fmu_me_enter_continuous_time(fmi2Component component, double start) {
    fmi2EventInfo info = {.newDiscreteStatesNeeded = fmi2True};
    fmi2Status status = fmu.SetupExperiment(component, fmi2False, 0.0, start, fmi2False, 0.0);
    status = worse(status, fmu.EnterInitializationMode(component));
    status = worse(status, fmu.ExitInitializationMode(component));
    while (status == fmi2OK && info.newDiscreteStatesNeeded) {
        status = fmu.NewDiscreteStates(component, &info);
    }
    return worse(status, fmu.EnterContinuousTimeMode(component));
}

fmi2Component fmu_me_initialized(struct fmu_log *log, double start) {
    const fmi2Component component = fmu_instantiate_as(fmi2ModelExchange, log, false);
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu_me_enter_continuous_time(component, start),
                                  log->texts);
    return component;
}

/* The slope k at time t and state x + h k_before. */
static fmi2Status slope(fmi2Component component, double t, const double x[FMU_STATES], double h,
                        const double k_before[FMU_STATES], double k[FMU_STATES]) {
    double at[FMU_STATES];
    for (int i = 0; i < FMU_STATES; i++) {
        at[i] = x[i] + h * k_before[i];
    }
    fmi2Status status = fmu.SetTime(component, t);
    status = worse(status, fmu.SetContinuousStates(component, at, FMU_STATES));
    return worse(status, fmu.GetDerivatives(component, k, FMU_STATES));
}

fmi2Status fmu_me_step(fmi2Component component, double t, double h) {
    double x[FMU_STATES] = {0};
    double k[4][FMU_STATES] = {0};
    fmi2Status status = fmu.GetContinuousStates(component, x, FMU_STATES);
    status = worse(status, slope(component, t, x, 0.0, x, k[0]));
    status = worse(status, slope(component, t + h / 2.0, x, h / 2.0, k[0], k[1]));
    status = worse(status, slope(component, t + h / 2.0, x, h / 2.0, k[1], k[2]));
    status = worse(status, slope(component, t + h, x, h, k[2], k[3]));
    for (int i = 0; i < FMU_STATES; i++) {
        x[i] += h / 6.0 * (k[0][i] + 2.0 * k[1][i] + 2.0 * k[2][i] + k[3][i]);
    }
    status = worse(status, fmu.SetContinuousStates(component, x, FMU_STATES));

    fmi2Boolean enter_event_mode = fmi2True;
    fmi2Boolean terminate = fmi2True;
    status = worse(status,
                   fmu.CompletedIntegratorStep(component, fmi2True, &enter_event_mode, &terminate));
    return enter_event_mode || terminate ? worse(status, fmi2Warning) : status;
}

/* ---- A run to compare bit for bit ----------------------------------------------------------- */

static const double run_start = 0.5;
static const double run_step = 0.01;

fmi2Status fmu_me_run_start(fmi2Component component, unsigned variant) {
    const fmi2ValueReference references[] = {RP_MANIPULATOR_q1, RP_MANIPULATOR_q2,
                                             RP_MANIPULATOR_dq1, RP_MANIPULATOR_m2};
    const double values[] = {0.3 + 0.01 * variant, 0.1, -0.5, 1.5};
    const fmi2Status status = fmu.SetReal(component, references, 4, values);
    return worse(status, fmu_me_enter_continuous_time(component, run_start));
}

fmi2Status fmu_me_run_step(fmi2Component component, unsigned step, struct fmu_run *run) {
    const fmi2ValueReference references[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2};
    const double values[] = {step / 3 % 5 - 2.0, 0.5 * (step / 3)};
    fmi2Status status = fmu.SetReal(component, references, 2, values);
    status = worse(status, fmu_me_step(component, run_start + step * run_step, run_step));
    return worse(status, fmu_get_all(component, &run->after[step]));
}

fmi2Status fmu_me_run(fmi2Component component, unsigned variant, struct fmu_run *run) {
    memset(run, 0, sizeof *run);
    fmi2Status status = fmu_me_run_start(component, variant);
    for (unsigned i = 0; i < FMU_RUN_STEPS; i++) {
        status = worse(status, fmu_me_run_step(component, i, run));
    }
    return status;
}

void fmu_me_assert_reset_is_fresh(fmi2Component component, const char *message) {
    static struct fmu_run fresh;
    static struct fmu_run again;
    static struct fmu_log log;
    const fmi2Component other = fmu_instantiate_as(fmi2ModelExchange, &log, false);
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu_me_run(other, 0, &fresh), message);
    fmu_free(other);

    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu.Reset(component), message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, fmu_me_run(component, 0, &again), message);
    TEST_ASSERT_EQUAL_MEMORY_MESSAGE(&fresh, &again, sizeof fresh, message);
}
