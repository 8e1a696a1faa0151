/* An FMU of FMI 3.0: its shared object and the functions of the standard header in it. */
#ifndef FMU3_LIBRARY_H
#define FMU3_LIBRARY_H

#include <stdbool.h>
#include <stddef.h>

#include <fmi3FunctionTypes.h>

/* Every function of fmi3Functions.h, without its prefix. */
#define FMU3_FUNCTION_LIST(X)                                                                      \
    X(GetVersion)                                                                                  \
    X(SetDebugLogging)                                                                             \
    X(InstantiateModelExchange)                                                                    \
    X(InstantiateCoSimulation)                                                                     \
    X(InstantiateScheduledExecution)                                                               \
    X(FreeInstance)                                                                                \
    X(EnterInitializationMode)                                                                     \
    X(ExitInitializationMode)                                                                      \
    X(EnterEventMode)                                                                              \
    X(Terminate)                                                                                   \
    X(Reset)                                                                                       \
    X(GetFloat32)                                                                                  \
    X(GetFloat64)                                                                                  \
    X(GetInt8)                                                                                     \
    X(GetUInt8)                                                                                    \
    X(GetInt16)                                                                                    \
    X(GetUInt16)                                                                                   \
    X(GetInt32)                                                                                    \
    X(GetUInt32)                                                                                   \
    X(GetInt64)                                                                                    \
    X(GetUInt64)                                                                                   \
    X(GetBoolean)                                                                                  \
    X(GetString)                                                                                   \
    X(GetBinary)                                                                                   \
    X(GetClock)                                                                                    \
    X(SetFloat32)                                                                                  \
    X(SetFloat64)                                                                                  \
    X(SetInt8)                                                                                     \
    X(SetUInt8)                                                                                    \
    X(SetInt16)                                                                                    \
    X(SetUInt16)                                                                                   \
    X(SetInt32)                                                                                    \
    X(SetUInt32)                                                                                   \
    X(SetInt64)                                                                                    \
    X(SetUInt64)                                                                                   \
    X(SetBoolean)                                                                                  \
    X(SetString)                                                                                   \
    X(SetBinary)                                                                                   \
    X(SetClock)                                                                                    \
    X(GetNumberOfVariableDependencies)                                                             \
    X(GetVariableDependencies)                                                                     \
    X(GetFMUState)                                                                                 \
    X(SetFMUState)                                                                                 \
    X(FreeFMUState)                                                                                \
    X(SerializedFMUStateSize)                                                                      \
    X(SerializeFMUState)                                                                           \
    X(DeserializeFMUState)                                                                         \
    X(GetDirectionalDerivative)                                                                    \
    X(GetAdjointDerivative)                                                                        \
    X(EnterConfigurationMode)                                                                      \
    X(ExitConfigurationMode)                                                                       \
    X(GetIntervalDecimal)                                                                          \
    X(GetIntervalFraction)                                                                         \
    X(GetShiftDecimal)                                                                             \
    X(GetShiftFraction)                                                                            \
    X(SetIntervalDecimal)                                                                          \
    X(SetIntervalFraction)                                                                         \
    X(SetShiftDecimal)                                                                             \
    X(SetShiftFraction)                                                                            \
    X(EvaluateDiscreteStates)                                                                      \
    X(UpdateDiscreteStates)                                                                        \
    /* Model Exchange */                                                                           \
    X(EnterContinuousTimeMode)                                                                     \
    X(CompletedIntegratorStep)                                                                     \
    X(SetTime)                                                                                     \
    X(SetContinuousStates)                                                                         \
    X(GetContinuousStateDerivatives)                                                               \
    X(GetEventIndicators)                                                                          \
    X(GetContinuousStates)                                                                         \
    X(GetNominalsOfContinuousStates)                                                               \
    X(GetNumberOfEventIndicators)                                                                  \
    X(GetNumberOfContinuousStates)                                                                 \
    /* Co-Simulation */                                                                            \
    X(EnterStepMode)                                                                               \
    X(GetOutputDerivatives)                                                                        \
    X(DoStep)                                                                                      \
    /* Scheduled Execution */                                                                      \
    X(ActivateModelPartition)

#define FMU3_CODE(name) FMU3_##name,
enum fmu3_function { FMU3_FUNCTION_LIST(FMU3_CODE) FMU3_FUNCTION_COUNT };
#undef FMU3_CODE

#define FMU3_POINTER(name) fmi3##name##TYPE *name;
struct fmu3_functions {
    FMU3_FUNCTION_LIST(FMU3_POINTER)
};
#undef FMU3_POINTER

/* As the standard spells it: "fmi3GetFloat64". */
extern const char *const fmu3_function_names[FMU3_FUNCTION_COUNT];

/* As fmu_library_open. */
void *fmu3_library_open(const char *path, struct fmu3_functions *functions);

#endif
