/* Functions of FMI 2.0 that the model description declares as not supported: each says so and
 * returns fmi2Error. The standard wants all of them exported. */
#include "component.h"

static fmi2Status refuse(fmi2Component c, enum call call, const char *flag) {
    struct component *component = c;
    if (component_enter(component, call)) {
        component_fail(component, "%s is not supported: the model description does not declare %s",
                       call_rules[call].name, flag);
    }
    return fmi2Error;
}

static fmi2Status refuse_model_exchange(fmi2Component c, enum call call) {
    struct component *component = c;
    if (component != NULL) {
        component_fail(component, "%s belongs to Model Exchange: this is a co-simulation instance",
                       call_rules[call].name);
    }
    return fmi2Error;
}

/* ---- FMU state and derivatives --------------------------------------------------------------- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    (void)FMUstate;
    return refuse(c, CALL_fmi2GetFMUstate, "canGetAndSetFMUstate");
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
    (void)FMUstate;
    return refuse(c, CALL_fmi2SetFMUstate, "canGetAndSetFMUstate");
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    if (c != NULL && (FMUstate == NULL || *FMUstate == NULL)) {
        return fmi2OK;
    }
    return refuse(c, CALL_fmi2FreeFMUstate, "canGetAndSetFMUstate");
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
    (void)FMUstate;
    (void)size;
    return refuse(c, CALL_fmi2SerializedFMUstateSize, "canSerializeFMUstate");
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[],
                                 size_t size) {
    (void)FMUstate;
    (void)serializedState;
    (void)size;
    return refuse(c, CALL_fmi2SerializeFMUstate, "canSerializeFMUstate");
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate) {
    (void)serializedState;
    (void)size;
    (void)FMUstate;
    return refuse(c, CALL_fmi2DeSerializeFMUstate, "canSerializeFMUstate");
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[],
                                        size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
    (void)vUnknown_ref;
    (void)nUnknown;
    (void)vKnown_ref;
    (void)nKnown;
    (void)dvKnown;
    (void)dvUnknown;
    return refuse(c, CALL_fmi2GetDirectionalDerivative, "providesDirectionalDerivative");
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    (void)vr;
    (void)nvr;
    (void)order;
    (void)value;
    return refuse(c, CALL_fmi2SetRealInputDerivatives, "canInterpolateInputs");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
    (void)vr;
    (void)nvr;
    (void)order;
    (void)value;
    return refuse(c, CALL_fmi2GetRealOutputDerivatives, "maxOutputDerivativeOrder");
}

/* ---- Model Exchange ------------------------------------------------------------------------- */

fmi2Status fmi2EnterEventMode(fmi2Component c) {
    return refuse_model_exchange(c, CALL_fmi2EnterEventMode);
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *fmi2eventInfo) {
    (void)fmi2eventInfo;
    return refuse_model_exchange(c, CALL_fmi2NewDiscreteStates);
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    return refuse_model_exchange(c, CALL_fmi2EnterContinuousTimeMode);
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c,
                                       fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode,
                                       fmi2Boolean *terminateSimulation) {
    (void)noSetFMUStatePriorToCurrentPoint;
    (void)enterEventMode;
    (void)terminateSimulation;
    return refuse_model_exchange(c, CALL_fmi2CompletedIntegratorStep);
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    (void)time;
    return refuse_model_exchange(c, CALL_fmi2SetTime);
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx) {
    (void)x;
    (void)nx;
    return refuse_model_exchange(c, CALL_fmi2SetContinuousStates);
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx) {
    (void)derivatives;
    (void)nx;
    return refuse_model_exchange(c, CALL_fmi2GetDerivatives);
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni) {
    (void)eventIndicators;
    (void)ni;
    return refuse_model_exchange(c, CALL_fmi2GetEventIndicators);
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx) {
    (void)x;
    (void)nx;
    return refuse_model_exchange(c, CALL_fmi2GetContinuousStates);
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx) {
    (void)x_nominal;
    (void)nx;
    return refuse_model_exchange(c, CALL_fmi2GetNominalsOfContinuousStates);
}
