/* The functions of FMI 2.0 for Model Exchange only (section 3.2). */
#include "continuous_time.h"
#include "fmi2_component.h"
#include "modes.h"

#include <math.h>

/* ---- Modes ---------------------------------------------------------------------------------- */

fmi2Status fmi2EnterEventMode(fmi2Component c) {
    return fmi2_status(mode_enter_event(c, CALL_fmi2EnterEventMode));
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *fmi2eventInfo) {
    const enum fmi2_call call = CALL_fmi2NewDiscreteStates;
    struct component *component = c;
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, 1, fmi2eventInfo, fmi2eventInfo)) {
        return fmi2Error;
    }
    struct discrete_update update;
    const enum component_status status = mode_update_discrete_states(component, &update);
    const bool has_next_time = isfinite(update.next_time);
    *fmi2eventInfo = (fmi2EventInfo){
        .newDiscreteStatesNeeded = update.is_incomplete ? fmi2True : fmi2False,
        .terminateSimulation = fmi2False,
        .nominalsOfContinuousStatesChanged = fmi2False,
        .valuesOfContinuousStatesChanged = update.states_changed ? fmi2True : fmi2False,
        .nextEventTimeDefined = has_next_time ? fmi2True : fmi2False,
        .nextEventTime = has_next_time ? update.next_time : 0.0,
    };
    return fmi2_status(status);
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    return fmi2_status(mode_enter_continuous_time(c, CALL_fmi2EnterContinuousTimeMode));
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c,
                                       fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode,
                                       fmi2Boolean *terminateSimulation) {
    bool is_event = false;
    const enum component_status status = continuous_complete_step(
        c, CALL_fmi2CompletedIntegratorStep, enterEventMode, terminateSimulation, &is_event);
    if (status == COMPONENT_OK) {
        *enterEventMode = is_event;
        *terminateSimulation = fmi2False;
    }
    return fmi2_status(status);
}

/* ---- Time and states ------------------------------------------------------------------------ */

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    return fmi2_status(continuous_set_time(c, CALL_fmi2SetTime, time));
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx) {
    return fmi2_status(continuous_set_states(c, CALL_fmi2SetContinuousStates, x, nx));
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx) {
    return fmi2_status(continuous_get_derivatives(c, CALL_fmi2GetDerivatives, derivatives, nx));
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni) {
    return fmi2_status(
        continuous_get_indicators(c, CALL_fmi2GetEventIndicators, eventIndicators, ni));
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx) {
    return fmi2_status(continuous_get_states(c, CALL_fmi2GetContinuousStates, x, nx));
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx) {
    return fmi2_status(
        continuous_get_nominals(c, CALL_fmi2GetNominalsOfContinuousStates, x_nominal, nx));
}
