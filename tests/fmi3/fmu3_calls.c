#include "fmu3_calls.h"

#include <string.h>

const double fmu3_calls_step = 0.01;

static const fmi3ValueReference q1 = RP_MANIPULATOR_q1;
static const fmi3ValueReference tau1 = RP_MANIPULATOR_tau1;

static fmi3Status ok_if(bool condition) {
    return condition ? fmi3OK : fmi3Error;
}

static fmi3Status call_without_instance(enum fmu3_function function) {
    fmi3Instance other = NULL;
    switch (function) {
    case FMU3_GetVersion:
        return ok_if(strcmp(fmu3.GetVersion(), "3.0") == 0);
    case FMU3_InstantiateModelExchange:
        other = fmu3.InstantiateModelExchange("other", RP_MANIPULATOR_TOKEN_FMI3, "", false, false,
                                              NULL, NULL);
        break;
    case FMU3_InstantiateCoSimulation:
        other = fmu3.InstantiateCoSimulation("other", RP_MANIPULATOR_TOKEN_FMI3, "", false, false,
                                             true, false, NULL, 0, NULL, NULL, NULL);
        break;
    default: // for Scheduled Execution there is none
        return ok_if(fmu3.InstantiateScheduledExecution("other", RP_MANIPULATOR_TOKEN_FMI3, "",
                                                        false, false, NULL, NULL, NULL, NULL,
                                                        NULL) == NULL);
    }
    fmu3.FreeInstance(other);
    return ok_if(other != NULL);
}

/* Of a type that no variable has, no value. */
static fmi3Status call_value_of_no_type(enum fmu3_function function, fmi3Instance c) {
    switch (function) {
    case FMU3_GetFloat32:
        return fmu3.GetFloat32(c, NULL, 0, NULL, 0);
    case FMU3_GetInt8:
        return fmu3.GetInt8(c, NULL, 0, NULL, 0);
    case FMU3_GetUInt8:
        return fmu3.GetUInt8(c, NULL, 0, NULL, 0);
    case FMU3_GetInt16:
        return fmu3.GetInt16(c, NULL, 0, NULL, 0);
    case FMU3_GetUInt16:
        return fmu3.GetUInt16(c, NULL, 0, NULL, 0);
    case FMU3_GetUInt32:
        return fmu3.GetUInt32(c, NULL, 0, NULL, 0);
    case FMU3_GetUInt64:
        return fmu3.GetUInt64(c, NULL, 0, NULL, 0);
    case FMU3_GetBoolean:
        return fmu3.GetBoolean(c, NULL, 0, NULL, 0);
    case FMU3_GetString:
        return fmu3.GetString(c, NULL, 0, NULL, 0);
    case FMU3_GetBinary:
        return fmu3.GetBinary(c, NULL, 0, NULL, NULL, 0);
    case FMU3_SetFloat32:
        return fmu3.SetFloat32(c, NULL, 0, NULL, 0);
    case FMU3_SetInt8:
        return fmu3.SetInt8(c, NULL, 0, NULL, 0);
    case FMU3_SetUInt8:
        return fmu3.SetUInt8(c, NULL, 0, NULL, 0);
    case FMU3_SetInt16:
        return fmu3.SetInt16(c, NULL, 0, NULL, 0);
    case FMU3_SetUInt16:
        return fmu3.SetUInt16(c, NULL, 0, NULL, 0);
    case FMU3_SetUInt32:
        return fmu3.SetUInt32(c, NULL, 0, NULL, 0);
    case FMU3_SetUInt64:
        return fmu3.SetUInt64(c, NULL, 0, NULL, 0);
    case FMU3_SetBoolean:
        return fmu3.SetBoolean(c, NULL, 0, NULL, 0);
    case FMU3_SetString:
        return fmu3.SetString(c, NULL, 0, NULL, 0);
    default:
        return fmu3.SetBinary(c, NULL, 0, NULL, NULL, 0);
    }
}

static fmi3Status call_value(enum fmu3_function function, fmi3Instance c) {
    double real = 1.0;
    switch (function) {
    case FMU3_GetFloat64:
        return fmu3.GetFloat64(c, &q1, 1, &real, 1);
    case FMU3_SetFloat64:
        return fmu3.SetFloat64(c, &tau1, 1, &real, 1);
    case FMU3_GetInt32: // no variable can be accessed in all states of the row
        return fmu3.GetInt32(c, NULL, 0, NULL, 0);
    case FMU3_SetInt32:
        return fmu3.SetInt32(c, NULL, 0, NULL, 0);
    case FMU3_GetInt64:
        return fmu3.GetInt64(c, NULL, 0, NULL, 0);
    case FMU3_SetInt64:
        return fmu3.SetInt64(c, NULL, 0, NULL, 0);
    default:
        return call_value_of_no_type(function, c);
    }
}

/* With a state that the instance has given out, or with none where it gives out none. */
static fmi3Status call_with_state(enum fmu3_function function, fmi3Instance c) {
    static fmi3Byte bytes[65536];
    fmi3FMUState state = NULL;
    fmi3FMUState copy = NULL;
    size_t size = 0;
    fmi3Status status = fmu3.GetFMUState(c, &state);
    if (function == FMU3_SetFMUState) {
        status = fmu3.SetFMUState(c, state);
    } else if (function != FMU3_GetFMUState) {
        const fmi3Status sized = fmu3.SerializedFMUStateSize(c, state, &size);
        status = function == FMU3_SerializedFMUStateSize
                     ? sized
                     : fmu3.SerializeFMUState(c, state, bytes, size);
    }
    if (function == FMU3_DeserializeFMUState) {
        status = fmu3.DeserializeFMUState(c, bytes, size, &copy);
    }
    if (state != NULL) {
        fmu3.FreeFMUState(c, &state);
    }
    if (copy != NULL) {
        fmu3.FreeFMUState(c, &copy);
    }
    return status;
}

/* Clocks, configuration, dependencies: refused whatever the arguments are. */
static fmi3Status call_unsupported(enum fmu3_function function, fmi3Instance c) {
    size_t count;
    switch (function) {
    case FMU3_GetClock:
        return fmu3.GetClock(c, NULL, 0, NULL);
    case FMU3_SetClock:
        return fmu3.SetClock(c, NULL, 0, NULL);
    case FMU3_GetIntervalDecimal:
        return fmu3.GetIntervalDecimal(c, NULL, 0, NULL, NULL);
    case FMU3_GetIntervalFraction:
        return fmu3.GetIntervalFraction(c, NULL, 0, NULL, NULL, NULL);
    case FMU3_GetShiftDecimal:
        return fmu3.GetShiftDecimal(c, NULL, 0, NULL);
    case FMU3_GetShiftFraction:
        return fmu3.GetShiftFraction(c, NULL, 0, NULL, NULL);
    case FMU3_SetIntervalDecimal:
        return fmu3.SetIntervalDecimal(c, NULL, 0, NULL);
    case FMU3_SetIntervalFraction:
        return fmu3.SetIntervalFraction(c, NULL, 0, NULL, NULL);
    case FMU3_SetShiftDecimal:
        return fmu3.SetShiftDecimal(c, NULL, 0, NULL);
    case FMU3_SetShiftFraction:
        return fmu3.SetShiftFraction(c, NULL, 0, NULL, NULL);
    case FMU3_EvaluateDiscreteStates:
        return fmu3.EvaluateDiscreteStates(c);
    case FMU3_EnterConfigurationMode:
        return fmu3.EnterConfigurationMode(c);
    case FMU3_ExitConfigurationMode:
        return fmu3.ExitConfigurationMode(c);
    case FMU3_GetNumberOfVariableDependencies:
        return fmu3.GetNumberOfVariableDependencies(c, q1, &count);
    case FMU3_GetVariableDependencies:
        return fmu3.GetVariableDependencies(c, q1, NULL, NULL, NULL, NULL, 0);
    default:
        return fmu3.ActivateModelPartition(c, 0, 0.0);
    }
}

static fmi3Status call_model_exchange(enum fmu3_function function, fmi3Instance c, double now) {
    double values[FMU3_STATES] = {0};
    bool flags[2];
    size_t count;
    switch (function) {
    case FMU3_EnterContinuousTimeMode:
        return fmu3.EnterContinuousTimeMode(c);
    case FMU3_CompletedIntegratorStep:
        return fmu3.CompletedIntegratorStep(c, true, &flags[0], &flags[1]);
    case FMU3_SetTime:
        return fmu3.SetTime(c, now);
    case FMU3_SetContinuousStates:
        return fmu3.SetContinuousStates(c, values, FMU3_STATES);
    case FMU3_GetContinuousStateDerivatives:
        return fmu3.GetContinuousStateDerivatives(c, values, FMU3_STATES);
    case FMU3_GetEventIndicators:
        return fmu3.GetEventIndicators(c, values, 0);
    case FMU3_GetContinuousStates:
        return fmu3.GetContinuousStates(c, values, FMU3_STATES);
    case FMU3_GetNominalsOfContinuousStates:
        return fmu3.GetNominalsOfContinuousStates(c, values, FMU3_STATES);
    case FMU3_GetNumberOfEventIndicators:
        return fmu3.GetNumberOfEventIndicators(c, &count);
    default:
        return fmu3.GetNumberOfContinuousStates(c, &count);
    }
}

static fmi3Status call_mode_or_step(enum fmu3_function function, fmi3Instance c, double now) {
    const fmi3Int32 order = 1;
    const double seed = 1.0;
    const fmi3ValueReference ddq1 = RP_MANIPULATOR_ddq1;
    bool flags[5];
    double real;
    switch (function) {
    case FMU3_SetDebugLogging:
        return fmu3.SetDebugLogging(c, false, 0, NULL);
    case FMU3_EnterInitializationMode:
        return fmu3.EnterInitializationMode(c, true, 1e-6, 0.0, true, 100.0);
    case FMU3_ExitInitializationMode:
        return fmu3.ExitInitializationMode(c);
    case FMU3_EnterEventMode:
        return fmu3.EnterEventMode(c);
    case FMU3_Terminate:
        return fmu3.Terminate(c);
    case FMU3_Reset:
        return fmu3.Reset(c);
    case FMU3_UpdateDiscreteStates:
        return fmu3.UpdateDiscreteStates(c, &flags[0], &flags[1], &flags[2], &flags[3], &flags[4],
                                         &real);
    case FMU3_GetDirectionalDerivative:
        return fmu3.GetDirectionalDerivative(c, &ddq1, 1, &tau1, 1, &seed, 1, &real, 1);
    case FMU3_GetAdjointDerivative:
        return fmu3.GetAdjointDerivative(c, &ddq1, 1, &tau1, 1, &seed, 1, &real, 1);
    case FMU3_EnterStepMode:
        return fmu3.EnterStepMode(c);
    case FMU3_GetOutputDerivatives:
        return fmu3.GetOutputDerivatives(c, &q1, 1, &order, &real, 1);
    default:
        return fmu3_try_step(c, now, fmu3_calls_step).status;
    }
}

fmi3Status fmu3_call(enum fmu3_function function, fmi3Instance c, double now) {
    fmi3FMUState no_state = NULL;
    switch (function) {
    case FMU3_GetVersion:
    case FMU3_InstantiateModelExchange:
    case FMU3_InstantiateCoSimulation:
    case FMU3_InstantiateScheduledExecution:
        return call_without_instance(function);
    case FMU3_FreeInstance:
        fmu3_free(c);
        return fmi3OK;
    case FMU3_FreeFMUState:
        return fmu3.FreeFMUState(c, &no_state);
    case FMU3_GetFMUState:
    case FMU3_SetFMUState:
    case FMU3_SerializedFMUStateSize:
    case FMU3_SerializeFMUState:
    case FMU3_DeserializeFMUState:
        return call_with_state(function, c);
    default:
        break;
    }
    if ((function >= FMU3_GetFloat32 && function <= FMU3_GetBinary) ||
        (function >= FMU3_SetFloat32 && function <= FMU3_SetBinary)) {
        return call_value(function, c);
    }
    if (function >= FMU3_EnterContinuousTimeMode && function <= FMU3_GetNumberOfContinuousStates) {
        return call_model_exchange(function, c, now);
    }
    switch (function) {
    case FMU3_SetDebugLogging:
    case FMU3_EnterInitializationMode:
    case FMU3_ExitInitializationMode:
    case FMU3_EnterEventMode:
    case FMU3_Terminate:
    case FMU3_Reset:
    case FMU3_UpdateDiscreteStates:
    case FMU3_GetDirectionalDerivative:
    case FMU3_GetAdjointDerivative:
    case FMU3_EnterStepMode:
    case FMU3_GetOutputDerivatives:
    case FMU3_DoStep:
        return call_mode_or_step(function, c, now);
    default:
        return call_unsupported(function, c);
    }
}
