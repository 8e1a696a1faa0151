#include "fmu_calls.h"

#include <stdlib.h>
#include <string.h>

static fmi2Status ok_if(bool condition) {
    return condition ? fmi2OK : fmi2Error;
}

static fmi2Status call_instantiate(void) {
    static const fmi2Type types[] = {fmi2CoSimulation, fmi2ModelExchange};
    const fmi2CallbackFunctions callbacks = {0};
    bool instantiated = true;
    for (size_t i = 0; i < FMU_COUNT(types); i++) {
        const fmi2Component other = fmu.Instantiate("other", types[i], RP_MANIPULATOR_GUID, "",
                                                    &callbacks, fmi2False, fmi2False);
        instantiated = instantiated && other != NULL;
        fmu.FreeInstance(other);
    }
    return ok_if(instantiated);
}

/* The status of the last call, made with a state that the instance has given out. */
static fmi2Status call_with_state(enum fmu_function function, fmi2Component c) {
    fmi2FMUstate state = NULL;
    fmi2FMUstate copy = NULL;
    size_t size = 0;
    fmi2Byte *bytes = NULL;

    fmi2Status status = fmu.GetFMUstate(c, &state);
    if (function == FMU_SetFMUstate) {
        status = fmu.SetFMUstate(c, state);
    } else if (function != FMU_GetFMUstate) {
        status = fmu.SerializedFMUstateSize(c, state, &size);
        bytes = calloc(size + 1, 1);
    }
    if (function == FMU_SerializeFMUstate || function == FMU_DeSerializeFMUstate) {
        status = fmu.SerializeFMUstate(c, state, bytes, size);
    }
    if (function == FMU_DeSerializeFMUstate) {
        status = fmu.DeSerializeFMUstate(c, bytes, size, &copy);
    }
    free(bytes);
    if (state != NULL) {
        fmu.FreeFMUstate(c, &state);
    }
    if (copy != NULL) {
        fmu.FreeFMUstate(c, &copy);
    }
    return status;
}

static fmi2Status call_model_exchange(enum fmu_function function, fmi2Component c, double now) {
    double values[4] = {0};
    fmi2EventInfo info = {0};
    fmi2Boolean flags[2];
    switch (function) {
    case FMU_EnterEventMode:
        return fmu.EnterEventMode(c);
    case FMU_NewDiscreteStates:
        return fmu.NewDiscreteStates(c, &info);
    case FMU_EnterContinuousTimeMode:
        return fmu.EnterContinuousTimeMode(c);
    case FMU_CompletedIntegratorStep:
        return fmu.CompletedIntegratorStep(c, fmi2True, &flags[0], &flags[1]);
    case FMU_SetTime:
        return fmu.SetTime(c, now);
    case FMU_SetContinuousStates:
        return fmu.SetContinuousStates(c, values, 4);
    case FMU_GetDerivatives:
        return fmu.GetDerivatives(c, values, 4);
    case FMU_GetEventIndicators:
        return fmu.GetEventIndicators(c, values, 0);
    case FMU_GetContinuousStates:
        return fmu.GetContinuousStates(c, values, 4);
    default:
        return fmu.GetNominalsOfContinuousStates(c, values, 4);
    }
}

fmi2Status fmu_call(enum fmu_function function, fmi2Component c, double now, double step) {
    const fmi2ValueReference q1 = RP_MANIPULATOR_q1;
    const fmi2ValueReference ddq1 = RP_MANIPULATOR_ddq1;
    const fmi2ValueReference tau1 = RP_MANIPULATOR_tau1;
    const fmi2ValueReference steps = RP_MANIPULATOR_solver_steps;
    const fmi2Integer first_order = 1;
    const double one = 1.0;
    double real;
    fmi2Integer integer;
    fmi2String text;
    fmi2FMUstate no_state = NULL;
    fmi2Status pending;

    switch (function) {
    case FMU_GetTypesPlatform:
        return ok_if(strcmp(fmu.GetTypesPlatform(), fmi2TypesPlatform) == 0);
    case FMU_GetVersion:
        return ok_if(strcmp(fmu.GetVersion(), "2.0") == 0);
    case FMU_SetDebugLogging:
        return fmu.SetDebugLogging(c, fmi2True, 0, NULL);
    case FMU_Instantiate:
        return call_instantiate();
    case FMU_FreeInstance:
        fmu_free(c);
        return fmi2OK;
    case FMU_SetupExperiment:
        return fmu.SetupExperiment(c, fmi2True, 1e-6, 0.0, fmi2True, 100.0);
    case FMU_EnterInitializationMode:
        return fmu.EnterInitializationMode(c);
    case FMU_ExitInitializationMode:
        return fmu.ExitInitializationMode(c);
    case FMU_Terminate:
        return fmu.Terminate(c);
    case FMU_Reset:
        return fmu.Reset(c);
    case FMU_GetReal:
        return fmu.GetReal(c, &q1, 1, &real);
    case FMU_GetInteger:
        return fmu.GetInteger(c, &steps, 1, &integer);
    case FMU_GetBoolean: // there is none of this type, nor of String
        return fmu.GetBoolean(c, NULL, 0, NULL);
    case FMU_GetString:
        return fmu.GetString(c, NULL, 0, NULL);
    case FMU_SetReal:
        return fmu.SetReal(c, &tau1, 1, &one);
    case FMU_SetInteger: // none that may be set in all states of the row
        return fmu.SetInteger(c, NULL, 0, NULL);
    case FMU_SetBoolean:
        return fmu.SetBoolean(c, NULL, 0, NULL);
    case FMU_SetString:
        return fmu.SetString(c, NULL, 0, NULL);
    case FMU_FreeFMUstate:
        return fmu.FreeFMUstate(c, &no_state);
    case FMU_GetFMUstate:
    case FMU_SetFMUstate:
    case FMU_SerializedFMUstateSize:
    case FMU_SerializeFMUstate:
    case FMU_DeSerializeFMUstate:
        return call_with_state(function, c);
    case FMU_GetDirectionalDerivative:
        return fmu.GetDirectionalDerivative(c, &ddq1, 1, &tau1, 1, &one, &real);
    case FMU_SetRealInputDerivatives:
        return fmu.SetRealInputDerivatives(c, &tau1, 1, &first_order, &one);
    case FMU_GetRealOutputDerivatives:
        return fmu.GetRealOutputDerivatives(c, &q1, 1, &first_order, &real);
    case FMU_DoStep:
        return fmu.DoStep(c, now, step, fmi2True);
    case FMU_CancelStep:
        return fmu.CancelStep(c);
    case FMU_GetStatus:
        return fmu.GetStatus(c, fmi2DoStepStatus, &pending);
    case FMU_GetRealStatus:
        return fmu.GetRealStatus(c, fmi2LastSuccessfulTime, &real);
    case FMU_GetIntegerStatus:
        return fmu.GetIntegerStatus(c, fmi2DoStepStatus, &integer);
    case FMU_GetBooleanStatus:
        return fmu.GetBooleanStatus(c, fmi2Terminated, &integer);
    case FMU_GetStringStatus:
        return fmu.GetStringStatus(c, fmi2PendingStatus, &text);
    default:
        return call_model_exchange(function, c, now);
    }
}
