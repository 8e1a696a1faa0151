/* A master for Model Exchange (section 3.2): initialization and a Runge-Kutta loop. */
#ifndef FMU_MODEL_EXCHANGE_H
#define FMU_MODEL_EXCHANGE_H

#include "fmu_harness.h"

/* SetupExperiment to EnterContinuousTimeMode, with the event iteration between them; no tolerance
 * and no stop time. */
fmi2Status fmu_me_enter_continuous_time(fmi2Component component, double start);

/* An instance in continuous-time mode at time start. */
fmi2Component fmu_me_initialized(struct fmu_log *log, double start);

/* One step of the classical Runge-Kutta method from t to t + h (s), with the inputs as set, and
 * CompletedIntegratorStep. */
fmi2Status fmu_me_step(fmi2Component component, double t, double h);

#endif
