/* Rules of the calls of FMI 3.0: every function of fmi3Functions.h without its prefix, with the
 * kinds and states of an instance in which it may be called: sections 2.3, 3.2 (Model Exchange) and
 * 4.2 (Co-Simulation) of the specification, as data. Functions that need no instance, and
 * FreeInstance, are always allowed. There are no structural parameters, so that no instance is ever
 * in configuration mode. Some functions answer in more states, because importers call them there:
 * those that return constants in every state, SetTime and GetOutputDerivatives in event mode. */
#pragma once

/* X(name, kinds, states), in the names of fmi3_calls.c */
#define FMI3_FUNCTION_LIST(X)                                                                      \
    X(GetVersion, ANY_KIND, ANY_STATE)                                                             \
    X(SetDebugLogging, ANY_KIND, OUTSIDE_STEP)                                                     \
    X(InstantiateModelExchange, ANY_KIND, ANY_STATE)                                               \
    X(InstantiateCoSimulation, ANY_KIND, ANY_STATE)                                                \
    X(InstantiateScheduledExecution, ANY_KIND, ANY_STATE)                                          \
    X(FreeInstance, ANY_KIND, ANY_STATE)                                                           \
    X(EnterInitializationMode, ANY_KIND, INSTANTIATED)                                             \
    X(ExitInitializationMode, ANY_KIND, INITIALIZATION)                                            \
    X(EnterEventMode, EVENT_KINDS, STEP | CONTINUOUS_TIME)                                         \
    X(Terminate, ANY_KIND, STEP | EVENT | CONTINUOUS_TIME)                                         \
    X(Reset, ANY_KIND, OUTSIDE_STEP)                                                               \
    X(GetFloat32, ANY_KIND, ANY_STATE)                                                             \
    X(GetFloat64, ANY_KIND, ANY_STATE)                                                             \
    X(GetInt8, ANY_KIND, ANY_STATE)                                                                \
    X(GetUInt8, ANY_KIND, ANY_STATE)                                                               \
    X(GetInt16, ANY_KIND, ANY_STATE)                                                               \
    X(GetUInt16, ANY_KIND, ANY_STATE)                                                              \
    X(GetInt32, ANY_KIND, ANY_STATE)                                                               \
    X(GetUInt32, ANY_KIND, ANY_STATE)                                                              \
    X(GetInt64, ANY_KIND, ANY_STATE)                                                               \
    X(GetUInt64, ANY_KIND, ANY_STATE)                                                              \
    X(GetBoolean, ANY_KIND, ANY_STATE)                                                             \
    X(GetString, ANY_KIND, ANY_STATE)                                                              \
    X(GetBinary, ANY_KIND, ANY_STATE)                                                              \
    X(GetClock, ANY_KIND, EVENT)                                                                   \
    X(SetFloat32, ANY_KIND, ANY_STATE & ~TERMINATED)                                               \
    X(SetFloat64, ANY_KIND, ANY_STATE & ~TERMINATED)                                               \
    X(SetInt8, ANY_KIND, ANY_STATE & ~TERMINATED)                                                  \
    X(SetUInt8, ANY_KIND, ANY_STATE & ~TERMINATED)                                                 \
    X(SetInt16, ANY_KIND, ANY_STATE & ~TERMINATED)                                                 \
    X(SetUInt16, ANY_KIND, ANY_STATE & ~TERMINATED)                                                \
    X(SetInt32, ANY_KIND, ANY_STATE & ~TERMINATED)                                                 \
    X(SetUInt32, ANY_KIND, ANY_STATE & ~TERMINATED)                                                \
    X(SetInt64, ANY_KIND, ANY_STATE & ~TERMINATED)                                                 \
    X(SetUInt64, ANY_KIND, ANY_STATE & ~TERMINATED)                                                \
    X(SetBoolean, ANY_KIND, ANY_STATE & ~TERMINATED)                                               \
    X(SetString, ANY_KIND, ANY_STATE & ~TERMINATED)                                                \
    X(SetBinary, ANY_KIND, ANY_STATE & ~TERMINATED)                                                \
    X(SetClock, ANY_KIND, EVENT)                                                                   \
    X(GetNumberOfVariableDependencies, ANY_KIND, ANY_STATE)                                        \
    X(GetVariableDependencies, ANY_KIND, ANY_STATE)                                                \
    X(GetFMUState, ANY_KIND, OUTSIDE_STEP)                                                         \
    X(SetFMUState, ANY_KIND, OUTSIDE_STEP)                                                         \
    X(FreeFMUState, ANY_KIND, OUTSIDE_STEP)                                                        \
    X(SerializedFMUStateSize, ANY_KIND, OUTSIDE_STEP)                                              \
    X(SerializeFMUState, ANY_KIND, OUTSIDE_STEP)                                                   \
    X(DeserializeFMUState, ANY_KIND, OUTSIDE_STEP)                                                 \
    X(GetDirectionalDerivative, ANY_KIND, OUTSIDE_STEP & ~INSTANTIATED)                            \
    X(GetAdjointDerivative, ANY_KIND, OUTSIDE_STEP & ~INSTANTIATED)                                \
    X(EnterConfigurationMode, ANY_KIND, INSTANTIATED | EVENT | STEP)                               \
    X(ExitConfigurationMode, ANY_KIND, 0)                                                          \
    X(GetIntervalDecimal, ANY_KIND, INITIALIZATION | EVENT)                                        \
    X(GetIntervalFraction, ANY_KIND, INITIALIZATION | EVENT)                                       \
    X(GetShiftDecimal, ANY_KIND, INITIALIZATION)                                                   \
    X(GetShiftFraction, ANY_KIND, INITIALIZATION)                                                  \
    X(SetIntervalDecimal, ANY_KIND, INITIALIZATION | EVENT)                                        \
    X(SetIntervalFraction, ANY_KIND, INITIALIZATION | EVENT)                                       \
    X(SetShiftDecimal, ANY_KIND, INITIALIZATION)                                                   \
    X(SetShiftFraction, ANY_KIND, INITIALIZATION)                                                  \
    X(EvaluateDiscreteStates, ANY_KIND, EVENT)                                                     \
    X(UpdateDiscreteStates, ANY_KIND, EVENT)                                                       \
    X(EnterContinuousTimeMode, MODEL_EXCHANGE, EVENT)                                              \
    X(CompletedIntegratorStep, MODEL_EXCHANGE, CONTINUOUS_TIME)                                    \
    X(SetTime, MODEL_EXCHANGE, EVENT | CONTINUOUS_TIME)                                            \
    X(SetContinuousStates, MODEL_EXCHANGE, CONTINUOUS_TIME)                                        \
    X(GetContinuousStateDerivatives, MODEL_EXCHANGE, OUTSIDE_STEP & ~INSTANTIATED)                 \
    X(GetEventIndicators, MODEL_EXCHANGE, OUTSIDE_STEP & ~INSTANTIATED)                            \
    X(GetContinuousStates, MODEL_EXCHANGE, OUTSIDE_STEP & ~INSTANTIATED)                           \
    X(GetNominalsOfContinuousStates, MODEL_EXCHANGE, ANY_STATE)                                    \
    X(GetNumberOfEventIndicators, MODEL_EXCHANGE, ANY_STATE)                                       \
    X(GetNumberOfContinuousStates, MODEL_EXCHANGE, ANY_STATE)                                      \
    X(EnterStepMode, CO_SIMULATION_WITH_EVENTS, EVENT)                                             \
    X(GetOutputDerivatives, CO_SIMULATION, STEP | EVENT | INTERMEDIATE_UPDATE | TERMINATED)        \
    X(DoStep, CO_SIMULATION, STEP)                                                                 \
    X(ActivateModelPartition, ANY_KIND, 0) /* only in Scheduled Execution */
