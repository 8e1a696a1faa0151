/* The functions of FMI 2.0 in a loaded library. */
#ifndef FMI2_FUNCTIONS_H
#define FMI2_FUNCTIONS_H

#include <stdbool.h>
#include <stddef.h>

#include <fmi2TypesPlatform.h>

#include <fmi2FunctionTypes.h>

/* Every function of fmi2Functions.h, without its prefix. */
#define FMI2_FUNCTION_LIST(X)                                                                      \
    X(GetTypesPlatform)                                                                            \
    X(GetVersion)                                                                                  \
    X(SetDebugLogging)                                                                             \
    X(Instantiate)                                                                                 \
    X(FreeInstance)                                                                                \
    X(SetupExperiment)                                                                             \
    X(EnterInitializationMode)                                                                     \
    X(ExitInitializationMode)                                                                      \
    X(Terminate)                                                                                   \
    X(Reset)                                                                                       \
    X(GetReal)                                                                                     \
    X(GetInteger)                                                                                  \
    X(GetBoolean)                                                                                  \
    X(GetString)                                                                                   \
    X(SetReal)                                                                                     \
    X(SetInteger)                                                                                  \
    X(SetBoolean)                                                                                  \
    X(SetString)                                                                                   \
    X(GetFMUstate)                                                                                 \
    X(SetFMUstate)                                                                                 \
    X(FreeFMUstate)                                                                                \
    X(SerializedFMUstateSize)                                                                      \
    X(SerializeFMUstate)                                                                           \
    X(DeSerializeFMUstate)                                                                         \
    X(GetDirectionalDerivative)                                                                    \
    X(EnterEventMode)                                                                              \
    X(NewDiscreteStates)                                                                           \
    X(EnterContinuousTimeMode)                                                                     \
    X(CompletedIntegratorStep)                                                                     \
    X(SetTime)                                                                                     \
    X(SetContinuousStates)                                                                         \
    X(GetDerivatives)                                                                              \
    X(GetEventIndicators)                                                                          \
    X(GetContinuousStates)                                                                         \
    X(GetNominalsOfContinuousStates)                                                               \
    X(SetRealInputDerivatives)                                                                     \
    X(GetRealOutputDerivatives)                                                                    \
    X(DoStep)                                                                                      \
    X(CancelStep)                                                                                  \
    X(GetStatus)                                                                                   \
    X(GetRealStatus)                                                                               \
    X(GetIntegerStatus)                                                                            \
    X(GetBooleanStatus)                                                                            \
    X(GetStringStatus)

#define FMI2_MEMBER(name) fmi2##name##TYPE *name;
struct fmi2_functions {
    FMI2_FUNCTION_LIST(FMI2_MEMBER)
};
#undef FMI2_MEMBER

#endif
