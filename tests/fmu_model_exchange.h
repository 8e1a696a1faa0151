/* A master for Model Exchange (section 3.2): initialization, a Runge-Kutta loop, and a run to
 * compare bit for bit. */
#ifndef FMU_MODEL_EXCHANGE_H
#define FMU_MODEL_EXCHANGE_H

#include "fmu_harness.h"

enum { FMU_STATES = 4 }; /* q1, q2, dq1, dq2 */

/* SetupExperiment to EnterContinuousTimeMode, with the event iteration between them; no tolerance
 * and no stop time. */
fmi2Status fmu_me_enter_continuous_time(fmi2Component component, double start);

/* An instance in continuous-time mode at time start. */
fmi2Component fmu_me_initialized(struct fmu_log *log, double start);

/* One step of the classical Runge-Kutta method from t to t + h (s), with the inputs as set, and
 * CompletedIntegratorStep. */
fmi2Status fmu_me_step(fmi2Component component, double t, double h);

/* As fmu_run and fmu_assert_reset_is_fresh. */
fmi2Status fmu_me_run_start(fmi2Component component, unsigned variant);
fmi2Status fmu_me_run_step(fmi2Component component, unsigned step, struct fmu_run *run);
fmi2Status fmu_me_run(fmi2Component component, unsigned variant, struct fmu_run *run);
void fmu_me_assert_reset_is_fresh(fmi2Component component, const char *message);

#endif
