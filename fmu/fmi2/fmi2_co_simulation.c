/* The functions of FMI 2.0 for Co-Simulation only (section 4.2). */
#include "fmi2_component.h"
#include "stepping.h"
#include "variable_access.h"

/* ---- Derivatives of inputs and outputs ------------------------------------------------------- */

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    return fmi2_status(
        access_set_input_derivatives(c, CALL_fmi2SetRealInputDerivatives, vr, nvr, order, value));
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
    return fmi2_status(
        access_get_output_derivatives(c, CALL_fmi2GetRealOutputDerivatives, vr, nvr, order, value));
}

/* ---- Steps ---------------------------------------------------------------------------------- */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    // importers say true, and roll back nevertheless
    struct component *component = c;
    if (!component_enter(component, CALL_fmi2DoStep)) {
        return fmi2Error;
    }
    const enum status status =
        instance_do_step(component->instance, currentCommunicationPoint, communicationStepSize);
    if (status_severity(status) == SEVERITY_DISCARD) {
        component->state = STATE_STEP_FAILED;
    }
    return fmi2_result(component, status);
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    // no state allows it: no step is ever pending
    return component_enter(c, CALL_fmi2CancelStep) ? fmi2OK : fmi2Error;
}

/* ---- Status --------------------------------------------------------------------------------- */

static bool may_ask(struct component *component, enum fmi2_call call, const void *value) {
    return component_enter(component, call) &&
           component_has_arrays(component, call, 1, value, value);
}

static fmi2Status no_status(struct component *component, enum fmi2_call call, const void *value) {
    if (!may_ask(component, call, value)) {
        return fmi2Error;
    }
    component_log(component, COMPONENT_DISCARD, LOG_STATUS_DISCARD,
                  "%s: this status cannot be known, no step is ever pending",
                  fmi2_call_rules[call].name);
    return fmi2Discard;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value) {
    return no_status(c, CALL_fmi2GetStatus, value);
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value) {
    struct component *component = c;
    if (s != fmi2LastSuccessfulTime) {
        return no_status(component, CALL_fmi2GetRealStatus, value);
    }
    if (!may_ask(component, CALL_fmi2GetRealStatus, value)) {
        return fmi2Error;
    }
    *value = instance_time(component->instance);
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value) {
    return no_status(c, CALL_fmi2GetIntegerStatus, value);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value) {
    if (s != fmi2Terminated) {
        return no_status(c, CALL_fmi2GetBooleanStatus, value);
    }
    if (!may_ask(c, CALL_fmi2GetBooleanStatus, value)) {
        return fmi2Error;
    }
    *value = fmi2False; // the FMU never ends a simulation by itself
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value) {
    return no_status(c, CALL_fmi2GetStringStatus, value);
}
