// An FMU that does nothing but go wrong: every Real variable is 0, but the one of value
// reference BROKEN, which is NaN after STEPS steps. Takes the place of any FMU's shared object.
#include <math.h>
#include <stdlib.h>

#include "fmi2FunctionTypes.h"

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible,
                              fmi2Boolean logging) {
    (void)name, (void)type, (void)guid, (void)resources, (void)callbacks, (void)visible,
        (void)logging;
    return calloc(1, sizeof(int));
}

void fmi2FreeInstance(fmi2Component steps) {
    free(steps);
}

const char *fmi2GetTypesPlatform(void) {
    return "default";
}

const char *fmi2GetVersion(void) {
    return "2.0";
}

fmi2Status fmi2DoStep(fmi2Component steps, fmi2Real time, fmi2Real length, fmi2Boolean final) {
    (void)time, (void)length, (void) final;
    ++*(int *)steps;
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component steps, const fmi2ValueReference references[], size_t n,
                       fmi2Real values[]) {
    for (size_t i = 0; i < n; ++i)
        values[i] = references[i] == BROKEN && *(int *)steps >= STEPS ? (double)NAN : 0.0;
    return fmi2OK;
}

#define DOES_NOTHING(function)                                                                     \
    fmi2Status function(void);                                                                     \
    fmi2Status function(void) {                                                                    \
        return fmi2OK;                                                                             \
    }
DOES_NOTHING(fmi2SetDebugLogging)
DOES_NOTHING(fmi2SetupExperiment)
DOES_NOTHING(fmi2EnterInitializationMode)
DOES_NOTHING(fmi2ExitInitializationMode)
DOES_NOTHING(fmi2Terminate)
DOES_NOTHING(fmi2Reset)
DOES_NOTHING(fmi2GetInteger)
DOES_NOTHING(fmi2GetBoolean)
DOES_NOTHING(fmi2GetString)
DOES_NOTHING(fmi2SetReal)
DOES_NOTHING(fmi2SetInteger)
DOES_NOTHING(fmi2SetBoolean)
DOES_NOTHING(fmi2SetString)
DOES_NOTHING(fmi2GetFMUstate)
DOES_NOTHING(fmi2SetFMUstate)
DOES_NOTHING(fmi2FreeFMUstate)
DOES_NOTHING(fmi2SerializedFMUstateSize)
DOES_NOTHING(fmi2SerializeFMUstate)
DOES_NOTHING(fmi2DeSerializeFMUstate)
DOES_NOTHING(fmi2GetDirectionalDerivative)
DOES_NOTHING(fmi2SetRealInputDerivatives)
DOES_NOTHING(fmi2GetRealOutputDerivatives)
DOES_NOTHING(fmi2CancelStep)
DOES_NOTHING(fmi2GetStatus)
DOES_NOTHING(fmi2GetRealStatus)
DOES_NOTHING(fmi2GetIntegerStatus)
DOES_NOTHING(fmi2GetBooleanStatus)
DOES_NOTHING(fmi2GetStringStatus)
