/* Rules of the calls of FMI 2.0: every function of fmi2Functions.h without its prefix, with the
 * kinds and states of an instance in which it may be called: the tables of section 3.2.3 (Model
 * Exchange) and section 4.2.4 (Co-Simulation) of the specification, as data. Functions that need no
 * instance, and FreeInstance, are always allowed. Derivatives and nominal values can also be read
 * in initialization mode: they are known there, and FMI 3.0 allows it. */
#pragma once

/* X(name, kinds, states), in the names of fmi2.c */
#define FMI2_FUNCTION_LIST(X)                                                                      \
    X(GetTypesPlatform, ANY_KIND, ANY_STATE)                                                       \
    X(GetVersion, ANY_KIND, ANY_STATE)                                                             \
    X(SetDebugLogging, ANY_KIND, ANY_STATE)                                                        \
    X(Instantiate, ANY_KIND, ANY_STATE)                                                            \
    X(FreeInstance, ANY_KIND, ANY_STATE)                                                           \
    X(SetupExperiment, ANY_KIND, INSTANTIATED)                                                     \
    X(EnterInitializationMode, ANY_KIND, INSTANTIATED)                                             \
    X(ExitInitializationMode, ANY_KIND, INITIALIZATION)                                            \
    X(Terminate, ANY_KIND, STEP_COMPLETE | STEP_FAILED | EVENT | CONTINUOUS_TIME)                  \
    X(Reset, ANY_KIND, ANY_STATE)                                                                  \
    X(GetReal, ANY_KIND, ANY_STATE & ~INSTANTIATED)                                                \
    X(GetInteger, ANY_KIND, ANY_STATE & ~INSTANTIATED)                                             \
    X(GetBoolean, ANY_KIND, ANY_STATE & ~INSTANTIATED)                                             \
    X(GetString, ANY_KIND, ANY_STATE & ~INSTANTIATED)                                              \
    X(SetReal, ANY_KIND, INSTANTIATED | INITIALIZATION | STEP_COMPLETE | EVENT | CONTINUOUS_TIME)  \
    X(SetInteger, ANY_KIND, INSTANTIATED | INITIALIZATION | STEP_COMPLETE | EVENT)                 \
    X(SetBoolean, ANY_KIND, INSTANTIATED | INITIALIZATION | STEP_COMPLETE | EVENT)                 \
    X(SetString, ANY_KIND, INSTANTIATED | INITIALIZATION | STEP_COMPLETE | EVENT)                  \
    X(GetFMUstate, ANY_KIND, ANY_STATE)                                                            \
    X(SetFMUstate, ANY_KIND, ANY_STATE)                                                            \
    X(FreeFMUstate, ANY_KIND, ANY_STATE)                                                           \
    X(SerializedFMUstateSize, ANY_KIND, ANY_STATE)                                                 \
    X(SerializeFMUstate, ANY_KIND, ANY_STATE)                                                      \
    X(DeSerializeFMUstate, ANY_KIND, ANY_STATE)                                                    \
    X(GetDirectionalDerivative, ANY_KIND, ANY_STATE & ~INSTANTIATED)                               \
    /* Model Exchange */                                                                           \
    X(EnterEventMode, MODEL_EXCHANGE, EVENT | CONTINUOUS_TIME)                                     \
    X(NewDiscreteStates, MODEL_EXCHANGE, EVENT)                                                    \
    X(EnterContinuousTimeMode, MODEL_EXCHANGE, EVENT)                                              \
    X(CompletedIntegratorStep, MODEL_EXCHANGE, CONTINUOUS_TIME)                                    \
    X(SetTime, MODEL_EXCHANGE, EVENT | CONTINUOUS_TIME)                                            \
    X(SetContinuousStates, MODEL_EXCHANGE, CONTINUOUS_TIME)                                        \
    X(GetDerivatives, MODEL_EXCHANGE, ANY_STATE & ~INSTANTIATED)                                   \
    X(GetEventIndicators, MODEL_EXCHANGE, ANY_STATE & ~INSTANTIATED)                               \
    X(GetContinuousStates, MODEL_EXCHANGE, ANY_STATE & ~INSTANTIATED)                              \
    X(GetNominalsOfContinuousStates, MODEL_EXCHANGE, ANY_STATE)                                    \
    /* Co-Simulation */                                                                            \
    X(SetRealInputDerivatives, CO_SIMULATION, INSTANTIATED | INITIALIZATION | STEP_COMPLETE)       \
    X(GetRealOutputDerivatives, CO_SIMULATION,                                                     \
      TERMINATED | ERROR_STATE | STEP_COMPLETE | STEP_FAILED)                                      \
    X(DoStep, CO_SIMULATION, STEP_COMPLETE)                                                        \
    X(CancelStep, CO_SIMULATION, 0) /* only while a step is pending: never */                      \
    X(GetStatus, CO_SIMULATION, TERMINATED | STEP_COMPLETE | STEP_FAILED)                          \
    X(GetRealStatus, CO_SIMULATION, TERMINATED | STEP_COMPLETE | STEP_FAILED)                      \
    X(GetIntegerStatus, CO_SIMULATION, TERMINATED | STEP_COMPLETE | STEP_FAILED)                   \
    X(GetBooleanStatus, CO_SIMULATION, TERMINATED | STEP_COMPLETE | STEP_FAILED)                   \
    X(GetStringStatus, CO_SIMULATION, TERMINATED | STEP_COMPLETE | STEP_FAILED)
