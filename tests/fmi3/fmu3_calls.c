#include "fmu3_calls.h"

#include <string.h>

const double fmu3_calls_step = 0.01;

static const fmi3ValueReference q1 = RP_MANIPULATOR_q1;
static const fmi3ValueReference tau1 = RP_MANIPULATOR_tau1;
static const fmi3ValueReference ddq1 = RP_MANIPULATOR_ddq1;
static const fmi3Int32 order = 1;
static const double one = 1.0;
static const double zeros[FMU_STATES];

// where results go
static bool flags[5];
static double reals[FMU_STATES];
static size_t count;

/* ---- With these arguments ------------------------------------------------------------------- */

#define CALL_PLAIN(name)                                                                           \
    static fmi3Status call_##name(fmi3Instance c, double now) {                                    \
        return fmu3.name(c);                                                                       \
    }
#define CALL(name, ...)                                                                            \
    static fmi3Status call_##name(fmi3Instance c, double now) {                                    \
        return fmu3.name(c, __VA_ARGS__);                                                          \
    }
CALL(SetDebugLogging, false, 0, NULL)
CALL(EnterInitializationMode, true, 1e-6, 0.0, true, 100.0)
CALL_PLAIN(ExitInitializationMode)
CALL_PLAIN(EnterEventMode)
CALL_PLAIN(Terminate)
CALL_PLAIN(Reset)
CALL(FreeFMUState, &(fmi3FMUState){NULL})
CALL(GetDirectionalDerivative, &ddq1, 1, &tau1, 1, &one, 1, reals, 1)
CALL(GetAdjointDerivative, &ddq1, 1, &tau1, 1, &one, 1, reals, 1)
CALL(UpdateDiscreteStates, &flags[0], &flags[1], &flags[2], &flags[3], &flags[4], reals)
CALL(GetFloat64, &q1, 1, reals, 1)
CALL(SetFloat64, &tau1, 1, &one, 1)

/* No value: of these types there is no variable, or none that is accessed in all states of the row.
 */
#define NO_VALUE(type)                                                                             \
    CALL(Get##type, NULL, 0, NULL, 0)                                                              \
    CALL(Set##type, NULL, 0, NULL, 0)
NO_VALUE(Float32)
NO_VALUE(Int8)
NO_VALUE(UInt8)
NO_VALUE(Int16)
NO_VALUE(UInt16)
NO_VALUE(Int32)
NO_VALUE(UInt32)
NO_VALUE(Int64)
NO_VALUE(UInt64)
NO_VALUE(Boolean)
NO_VALUE(String)
CALL(GetBinary, NULL, 0, NULL, NULL, 0)
CALL(SetBinary, NULL, 0, NULL, NULL, 0)

// Model Exchange
CALL_PLAIN(EnterContinuousTimeMode)
CALL(CompletedIntegratorStep, true, &flags[0], &flags[1])
CALL(SetTime, now)
CALL(SetContinuousStates, zeros, FMU_STATES)
CALL(GetContinuousStateDerivatives, reals, FMU_STATES)
CALL(GetEventIndicators, reals, 0)
CALL(GetContinuousStates, reals, FMU_STATES)
CALL(GetNominalsOfContinuousStates, reals, FMU_STATES)
CALL(GetNumberOfEventIndicators, &count)
CALL(GetNumberOfContinuousStates, &count)

// Co-Simulation
CALL_PLAIN(EnterStepMode)
CALL(GetOutputDerivatives, &q1, 1, &order, reals, 1)

// clocks, configuration, dependencies: refused whatever the arguments are
CALL(GetClock, NULL, 0, NULL)
CALL(SetClock, NULL, 0, NULL)
CALL(GetIntervalDecimal, NULL, 0, NULL, NULL)
CALL(GetIntervalFraction, NULL, 0, NULL, NULL, NULL)
CALL(GetShiftDecimal, NULL, 0, NULL)
CALL(GetShiftFraction, NULL, 0, NULL, NULL)
CALL(SetIntervalDecimal, NULL, 0, NULL)
CALL(SetIntervalFraction, NULL, 0, NULL, NULL)
CALL(SetShiftDecimal, NULL, 0, NULL)
CALL(SetShiftFraction, NULL, 0, NULL, NULL)
CALL_PLAIN(EvaluateDiscreteStates)
CALL_PLAIN(EnterConfigurationMode)
CALL_PLAIN(ExitConfigurationMode)
CALL(GetNumberOfVariableDependencies, q1, &count)
CALL(GetVariableDependencies, q1, NULL, NULL, NULL, NULL, 0)
CALL(ActivateModelPartition, 0, 0.0)

/* ---- With more than arguments --------------------------------------------------------------- */

static fmi3Status ok_if(bool condition) {
    return condition ? fmi3OK : fmi3Error;
}

static fmi3Status call_GetVersion(fmi3Instance c, double now) {
    return ok_if(strcmp(fmu3.GetVersion(), "3.0") == 0);
}

static fmi3Status freed(fmi3Instance made) {
    fmu3.FreeInstance(made);
    return ok_if(made != NULL);
}

static fmi3Status call_InstantiateModelExchange(fmi3Instance c, double now) {
    return freed(fmu3.InstantiateModelExchange("other", RP_MANIPULATOR_TOKEN_FMI3, "", false, false,
                                               NULL, NULL));
}

static fmi3Status call_InstantiateCoSimulation(fmi3Instance c, double now) {
    return freed(fmu3.InstantiateCoSimulation("other", RP_MANIPULATOR_TOKEN_FMI3, "", false, false,
                                              true, false, NULL, 0, NULL, NULL, NULL));
}

/* There is none. */
static fmi3Status call_InstantiateScheduledExecution(fmi3Instance c, double now) {
    return ok_if(fmu3.InstantiateScheduledExecution("other", RP_MANIPULATOR_TOKEN_FMI3, "", false,
                                                    false, NULL, NULL, NULL, NULL, NULL) == NULL);
}

static fmi3Status call_FreeInstance(fmi3Instance c, double now) {
    fmu3_free(c);
    return fmi3OK;
}

static fmi3Status call_DoStep(fmi3Instance c, double now) {
    return fmu3_try_step(c, now, fmu3_calls_step).status;
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

#define CALL_WITH_STATE(name)                                                                      \
    static fmi3Status call_##name(fmi3Instance c, double now) {                                    \
        return call_with_state(FMU3_##name, c);                                                    \
    }
CALL_WITH_STATE(GetFMUState)
CALL_WITH_STATE(SetFMUState)
CALL_WITH_STATE(SerializedFMUStateSize)
CALL_WITH_STATE(SerializeFMUState)
CALL_WITH_STATE(DeserializeFMUState)

fmi3Status fmu3_call(enum fmu3_function function, fmi3Instance c, double now) {
#define CALL_OF(name, kinds, states) call_##name,
    static fmi3Status (*const calls[])(fmi3Instance c, double now) = {FMI3_FUNCTION_LIST(CALL_OF)};
#undef CALL_OF
    return calls[function](c, now);
}
