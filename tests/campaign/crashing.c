/* A small FMU of FMI 2.0: y = x. It takes its process down in the step of a run with x = 3. */
#include <stdlib.h>

#include "fmi2FunctionTypes.h"

/* What importers look for and nobody calls here. */
#define UNUSED(name)                                                                               \
    fmi2Status name(void);                                                                         \
    fmi2Status name(void) {                                                                        \
        return fmi2Error;                                                                          \
    }

UNUSED(fmi2SetDebugLogging)
UNUSED(fmi2GetInteger)
UNUSED(fmi2GetBoolean)
UNUSED(fmi2GetString)
UNUSED(fmi2SetInteger)
UNUSED(fmi2SetBoolean)
UNUSED(fmi2SetString)
UNUSED(fmi2GetFMUstate)
UNUSED(fmi2SetFMUstate)
UNUSED(fmi2FreeFMUstate)
UNUSED(fmi2SerializedFMUstateSize)
UNUSED(fmi2SerializeFMUstate)
UNUSED(fmi2DeSerializeFMUstate)
UNUSED(fmi2GetDirectionalDerivative)
UNUSED(fmi2SetRealInputDerivatives)
UNUSED(fmi2GetRealOutputDerivatives)
UNUSED(fmi2CancelStep)
UNUSED(fmi2GetStatus)
UNUSED(fmi2GetRealStatus)
UNUSED(fmi2GetIntegerStatus)
UNUSED(fmi2GetBooleanStatus)
UNUSED(fmi2GetStringStatus)

struct instance {
    double x;
};

const char *fmi2GetTypesPlatform(void) {
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void) {
    return "2.0";
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String location,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible,
                              fmi2Boolean logging) {
    (void)name, (void)type, (void)guid, (void)location, (void)callbacks, (void)visible;
    (void)logging;
    return calloc(1, sizeof(struct instance));
}

void fmi2FreeInstance(fmi2Component component) {
    free(component);
}

fmi2Status fmi2Reset(fmi2Component component) {
    ((struct instance *)component)->x = 0.0;
    return fmi2OK;
}

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean has_tolerance,
                               fmi2Real tolerance, fmi2Real start, fmi2Boolean has_stop,
                               fmi2Real stop) {
    (void)component, (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component) {
    (void)component;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component) {
    (void)component;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component component) {
    (void)component;
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference references[], size_t count,
                       const fmi2Real values[]) {
    for (size_t i = 0; i < count; i++) {
        if (references[i] != 1) {
            return fmi2Error;
        }
        ((struct instance *)component)->x = values[i];
    }
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference references[], size_t count,
                       fmi2Real values[]) {
    for (size_t i = 0; i < count; i++) {
        if (references[i] != 2) {
            return fmi2Error;
        }
        values[i] = ((struct instance *)component)->x;
    }
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real time, fmi2Real step, fmi2Boolean last) {
    (void)time, (void)step, (void)last;
    if (((struct instance *)component)->x == 3.0) {
        abort();
    }
    return fmi2OK;
}
