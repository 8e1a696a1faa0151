#include "fmu_model_exchange.h"

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
