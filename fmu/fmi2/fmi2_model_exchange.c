/* The functions of FMI 2.0 for Model Exchange only (section 3.2). Models have no events so far. */
#include "continuous_states.h"
#include "fmi2_component.h"

/* ---- Modes ---------------------------------------------------------------------------------- */

fmi2Status fmi2EnterEventMode(fmi2Component c) {
    struct component *component = c;
    if (!component_enter(component, CALL_fmi2EnterEventMode)) {
        return fmi2Error;
    }
    instance_enter_event_mode(component->instance);
    component->state = STATE_EVENT;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *fmi2eventInfo) {
    const enum fmi2_call call = CALL_fmi2NewDiscreteStates;
    struct component *component = c;
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, 1, fmi2eventInfo, fmi2eventInfo)) {
        return fmi2Error;
    }
    *fmi2eventInfo = (fmi2EventInfo){
        .newDiscreteStatesNeeded = fmi2False,
        .terminateSimulation = fmi2False,
        .nominalsOfContinuousStatesChanged = fmi2False,
        .valuesOfContinuousStatesChanged = fmi2False,
        .nextEventTimeDefined = fmi2False,
    };
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    struct component *component = c;
    if (!component_enter(component, CALL_fmi2EnterContinuousTimeMode)) {
        return fmi2Error;
    }
    const enum status status = instance_enter_continuous_time(component->instance);
    if (status == STATUS_OK) {
        component->state = STATE_CONTINUOUS_TIME;
    }
    return fmi2_result(component, status);
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c,
                                       fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode,
                                       fmi2Boolean *terminateSimulation) {
    (void)noSetFMUStatePriorToCurrentPoint;
    const enum fmi2_call call = CALL_fmi2CompletedIntegratorStep;
    struct component *component = c;
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, 1, enterEventMode, terminateSimulation)) {
        return fmi2Error;
    }
    *enterEventMode = fmi2False;
    *terminateSimulation = fmi2False;
    return fmi2OK;
}

/* ---- Time and states ------------------------------------------------------------------------ */

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    struct component *component = c;
    if (!component_enter(component, CALL_fmi2SetTime)) {
        return fmi2Error;
    }
    return fmi2_result(component, instance_set_time(component->instance, time));
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx) {
    struct component *component = c;
    if (!component_enter(component, CALL_fmi2SetContinuousStates) ||
        !component_has_arrays(component, CALL_fmi2SetContinuousStates, nx, x, x)) {
        return fmi2Error;
    }
    return fmi2_result(component, instance_set_states(component->instance, x, nx));
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx) {
    struct component *component = c;
    if (!component_enter(component, CALL_fmi2GetDerivatives) ||
        !component_has_arrays(component, CALL_fmi2GetDerivatives, nx, derivatives, derivatives)) {
        return fmi2Error;
    }
    return fmi2_result(component, instance_get_derivatives(component->instance, derivatives, nx));
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni) {
    (void)eventIndicators;
    struct component *component = c;
    if (!component_enter(component, CALL_fmi2GetEventIndicators)) {
        return fmi2Error;
    }
    if (ni > 0) {
        return fmi2_status(
            component_fail(component, "%zu event indicators are accessed: there are none", ni));
    }
    return fmi2OK;
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx) {
    struct component *component = c;
    if (!component_enter(component, CALL_fmi2GetContinuousStates) ||
        !component_has_arrays(component, CALL_fmi2GetContinuousStates, nx, x, x)) {
        return fmi2Error;
    }
    return fmi2_result(component, instance_get_states(component->instance, x, nx));
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx) {
    const enum fmi2_call call = CALL_fmi2GetNominalsOfContinuousStates;
    struct component *component = c;
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, nx, x_nominal, x_nominal)) {
        return fmi2Error;
    }
    return fmi2_result(component, instance_get_nominals(component->instance, x_nominal, nx));
}
