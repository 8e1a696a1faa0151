/* The functions of FMI 3.0 for Model Exchange only (section 3.2). */
#include "continuous_states.h"
#include "continuous_time.h"
#include "fmi3_component.h"
#include "model_description.h"
#include "modes.h"

/* ---- Modes ---------------------------------------------------------------------------------- */

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
    return fmi3_status(mode_enter_continuous_time(instance, CALL_fmi3EnterContinuousTimeMode));
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance,
                                       fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi3Boolean *enterEventMode,
                                       fmi3Boolean *terminateSimulation) {
    bool is_event = false;
    const enum component_status status = continuous_complete_step(
        instance, CALL_fmi3CompletedIntegratorStep, enterEventMode, terminateSimulation, &is_event);
    if (status == COMPONENT_OK) {
        *enterEventMode = is_event;
        *terminateSimulation = fmi3False;
    }
    return fmi3_status(status);
}

/* ---- Time and states ------------------------------------------------------------------------ */

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time) {
    return fmi3_status(continuous_set_time(instance, CALL_fmi3SetTime, time));
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 continuousStates[],
                                   size_t nContinuousStates) {
    return fmi3_status(continuous_set_states(instance, CALL_fmi3SetContinuousStates,
                                             continuousStates, nContinuousStates));
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 continuousStates[],
                                   size_t nContinuousStates) {
    return fmi3_status(continuous_get_states(instance, CALL_fmi3GetContinuousStates,
                                             continuousStates, nContinuousStates));
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[],
                                             size_t nContinuousStates) {
    return fmi3_status(continuous_get_derivatives(instance, CALL_fmi3GetContinuousStateDerivatives,
                                                  derivatives, nContinuousStates));
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[],
                                             size_t nContinuousStates) {
    return fmi3_status(continuous_get_nominals(instance, CALL_fmi3GetNominalsOfContinuousStates,
                                               nominals, nContinuousStates));
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 eventIndicators[],
                                  size_t nEventIndicators) {
    return fmi3_status(continuous_get_indicators(instance, CALL_fmi3GetEventIndicators,
                                                 eventIndicators, nEventIndicators));
}

/* ---- Numbers -------------------------------------------------------------------------------- */

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *nEventIndicators) {
    const enum fmi3_call call = CALL_fmi3GetNumberOfEventIndicators;
    struct component *component = instance;
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, 1, nEventIndicators, nEventIndicators)) {
        return fmi3Error;
    }
    *nEventIndicators = model_description.indicator_count;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *nContinuousStates) {
    const enum fmi3_call call = CALL_fmi3GetNumberOfContinuousStates;
    struct component *component = instance;
    if (!component_enter(component, call) ||
        !component_has_arrays(component, call, 1, nContinuousStates, nContinuousStates)) {
        return fmi3Error;
    }
    *nContinuousStates = instance_state_count(component->instance);
    return fmi3OK;
}
