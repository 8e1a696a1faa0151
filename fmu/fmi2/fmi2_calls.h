/* Which function of FMI 2.0 may be called in which state: the tables of section 3.2.3 (Model
 * Exchange) and section 4.2.4 (Co-Simulation) of the specification, as data. Functions that need no
 * instance, and fmi2FreeInstance, which works in every state, are not in it. */
#ifndef FMI2_CALLS_H
#define FMI2_CALLS_H

#include "calls.h"

#define FMI2_CALL_LIST(X)                                                                          \
    X(fmi2SetDebugLogging, ANY_KIND, ANY_STATE)                                                    \
    X(fmi2Reset, ANY_KIND, ANY_STATE)                                                              \
    X(fmi2SetupExperiment, ANY_KIND, INSTANTIATED)                                                 \
    X(fmi2EnterInitializationMode, ANY_KIND, INSTANTIATED)                                         \
    X(fmi2ExitInitializationMode, ANY_KIND, INITIALIZATION)                                        \
    X(fmi2Terminate, ANY_KIND, STEP_COMPLETE | STEP_FAILED | EVENT | CONTINUOUS_TIME)              \
    X(fmi2GetReal, ANY_KIND, ANY_STATE & ~INSTANTIATED)                                            \
    X(fmi2GetInteger, ANY_KIND, ANY_STATE & ~INSTANTIATED)                                         \
    X(fmi2GetBoolean, ANY_KIND, ANY_STATE & ~INSTANTIATED)                                         \
    X(fmi2GetString, ANY_KIND, ANY_STATE & ~INSTANTIATED)                                          \
    X(fmi2SetReal, ANY_KIND,                                                                       \
      INSTANTIATED | INITIALIZATION | STEP_COMPLETE | EVENT | CONTINUOUS_TIME)                     \
    X(fmi2SetInteger, ANY_KIND, INSTANTIATED | INITIALIZATION | STEP_COMPLETE | EVENT)             \
    X(fmi2SetBoolean, ANY_KIND, INSTANTIATED | INITIALIZATION | STEP_COMPLETE | EVENT)             \
    X(fmi2SetString, ANY_KIND, INSTANTIATED | INITIALIZATION | STEP_COMPLETE | EVENT)              \
    X(fmi2GetFMUstate, ANY_KIND, ANY_STATE)                                                        \
    X(fmi2SetFMUstate, ANY_KIND, ANY_STATE)                                                        \
    X(fmi2FreeFMUstate, ANY_KIND, ANY_STATE)                                                       \
    X(fmi2SerializedFMUstateSize, ANY_KIND, ANY_STATE)                                             \
    X(fmi2SerializeFMUstate, ANY_KIND, ANY_STATE)                                                  \
    X(fmi2DeSerializeFMUstate, ANY_KIND, ANY_STATE)                                                \
    X(fmi2GetDirectionalDerivative, ANY_KIND, ANY_STATE & ~INSTANTIATED)                           \
    X(fmi2SetRealInputDerivatives, CO_SIMULATION, INSTANTIATED | INITIALIZATION | STEP_COMPLETE)   \
    X(fmi2GetRealOutputDerivatives, CO_SIMULATION,                                                 \
      TERMINATED | ERROR_STATE | STEP_COMPLETE | STEP_FAILED)                                      \
    X(fmi2DoStep, CO_SIMULATION, STEP_COMPLETE)                                                    \
    X(fmi2CancelStep, CO_SIMULATION, 0) /* only while a step is pending: never */                  \
    X(fmi2GetStatus, CO_SIMULATION, TERMINATED | STEP_COMPLETE | STEP_FAILED)                      \
    X(fmi2GetRealStatus, CO_SIMULATION, TERMINATED | STEP_COMPLETE | STEP_FAILED)                  \
    X(fmi2GetIntegerStatus, CO_SIMULATION, TERMINATED | STEP_COMPLETE | STEP_FAILED)               \
    X(fmi2GetBooleanStatus, CO_SIMULATION, TERMINATED | STEP_COMPLETE | STEP_FAILED)               \
    X(fmi2GetStringStatus, CO_SIMULATION, TERMINATED | STEP_COMPLETE | STEP_FAILED)                \
    X(fmi2EnterEventMode, MODEL_EXCHANGE, EVENT | CONTINUOUS_TIME)                                 \
    X(fmi2NewDiscreteStates, MODEL_EXCHANGE, EVENT)                                                \
    X(fmi2EnterContinuousTimeMode, MODEL_EXCHANGE, EVENT)                                          \
    X(fmi2CompletedIntegratorStep, MODEL_EXCHANGE, CONTINUOUS_TIME)                                \
    X(fmi2SetTime, MODEL_EXCHANGE, EVENT | CONTINUOUS_TIME)                                        \
    X(fmi2SetContinuousStates, MODEL_EXCHANGE, CONTINUOUS_TIME)                                    \
    X(fmi2GetDerivatives, MODEL_EXCHANGE, TERMINATED | ERROR_STATE | EVENT | CONTINUOUS_TIME)      \
    X(fmi2GetEventIndicators, MODEL_EXCHANGE, ANY_STATE & ~INSTANTIATED)                           \
    X(fmi2GetContinuousStates, MODEL_EXCHANGE, ANY_STATE & ~INSTANTIATED)                          \
    X(fmi2GetNominalsOfContinuousStates, MODEL_EXCHANGE, ANY_STATE & ~INITIALIZATION)

#define FMI2_CALL_CODE(name, kinds, states) CALL_##name,
enum fmi2_call { FMI2_CALL_LIST(FMI2_CALL_CODE) FMI2_CALL_COUNT };
#undef FMI2_CALL_CODE

extern const struct call_rule fmi2_call_rules[FMI2_CALL_COUNT];

#endif
