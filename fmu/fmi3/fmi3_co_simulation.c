/* The functions of FMI 3.0 for Co-Simulation only (section 4.2). */
#include "fmi3_component.h"
#include "modes.h"
#include "stepping.h"
#include "variable_access.h"

fmi3Status fmi3EnterStepMode(fmi3Instance instance) {
    return fmi3_status(mode_enter_step(instance, CALL_fmi3EnterStepMode));
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance,
                                    const fmi3ValueReference valueReferences[],
                                    size_t nValueReferences, const fmi3Int32 orders[],
                                    fmi3Float64 values[], size_t nValues) {
    const enum fmi3_call call = CALL_fmi3GetOutputDerivatives;
    if (!fmi3_has_count(instance, call, nValues, nValueReferences) ||
        !fmi3_may_access(instance, call, false, valueReferences, nValueReferences)) {
        return fmi3Error;
    }
    return fmi3_status(access_get_output_derivatives(instance, call, valueReferences,
                                                     nValueReferences, orders, values));
}

/* ---- Intermediate updates -------------------------------------------------------------------- */

/* What the importer has asked for. */
struct answer {
    fmi3Boolean returns_early;
    fmi3Float64 early_time;
};

/* Calls the importer in intermediate update mode; an error there ends the step. */
static enum status update(struct fmi3_component *component, double time, bool can_return_early,
                          struct answer *answer) {
    struct component *base = &component->base;
    *answer = (struct answer){.returns_early = fmi3False, .early_time = time};
    base->state = STATE_INTERMEDIATE_UPDATE;
    base->has_failed_inside = false;
    component->update(component->environment, time, component->can_set, component->can_get,
                      component->can_get, can_return_early, &answer->returns_early,
                      &answer->early_time);
    base->state = STATE_STEP_COMPLETE;
    return base->has_failed_inside ? STATUS_INVALID_ARGUMENT : STATUS_OK;
}

/* Before the step: the importer sets the inputs at this time. */
static enum status ask_inputs(void *component_pointer, double time) {
    struct fmi3_component *component = component_pointer;
    struct answer answer;
    component->can_set = true;
    component->can_get = false;
    return update(component, time, false, &answer);
}

/* After an internal step: the importer gets outputs, and may ask for the end of the step. */
static enum status accept(void *component_pointer, double time, double *end) {
    struct fmi3_component *component = component_pointer;
    const bool can_return_early = component->early_return_allowed && time < *end;
    struct answer answer;
    component->can_set = false;
    component->can_get = true;
    const enum status status = update(component, time, can_return_early, &answer);
    if (can_return_early && answer.returns_early && answer.early_time < *end) {
        *end = answer.early_time;
    }
    return status;
}

enum status fmi3_prepare_steps(struct fmi3_component *component) {
    component->options.context = component;
    if (component->early_return_allowed) {
        const bool handles_events = component->base.kind == KIND_CO_SIMULATION_WITH_EVENTS;
        component->options.at_event = handles_events ? EVENTS_LEFT : EVENTS_END;
    }
    if (component->update != NULL) {
        component->options.ask_inputs = component->asks_inputs ? ask_inputs : NULL;
        component->options.accept = accept;
    }
    return instance_save(component->base.instance, 0, &component->options.undo);
}

/* ---- Steps ---------------------------------------------------------------------------------- */

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
                      fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                      fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                      fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime) {
    // importers say true, and roll back nevertheless
    const enum fmi3_call call = CALL_fmi3DoStep;
    struct component *base = instance;
    if (!component_enter(base, call) ||
        !component_has_arrays(base, call, 1, eventHandlingNeeded, terminateSimulation) ||
        !component_has_arrays(base, call, 1, earlyReturn, lastSuccessfulTime)) {
        return fmi3Error;
    }
    const struct fmi3_component *component = instance;
    const enum status status = instance_do_step_with(base->instance, currentCommunicationPoint,
                                                     communicationStepSize, &component->options);
    if (status == STATUS_OK) {
        *eventHandlingNeeded =
            base->kind == KIND_CO_SIMULATION_WITH_EVENTS && instance_met_event(base->instance);
        *terminateSimulation = fmi3False;
        *lastSuccessfulTime = instance_time(base->instance);
        *earlyReturn = *lastSuccessfulTime < currentCommunicationPoint + communicationStepSize;
    }
    return fmi3_status(component_result(base, status));
}
