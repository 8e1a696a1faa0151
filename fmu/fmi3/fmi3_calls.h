/* Rules of the calls of FMI 3.0, and the structure that an fmi3Instance points to.
 *
 * The rules say which function may be called in which state: sections 2.3, 3.2 (Model Exchange) and
 * 4.2 (Co-Simulation) of the specification, as data. Functions that need no instance, and
 * fmi3FreeInstance, are not in it. There are no structural parameters, so that no instance is ever
 * in configuration mode. Some functions answer in more states, because importers call them there:
 * those that return constants in every state, fmi3SetTime and fmi3GetOutputDerivatives in event
 * mode. */
#pragma once

#include "component.h"
#include "fmi3Functions.h"
#include "stepping.h"

#include <stdint.h>

#define FMI3_CALL_LIST(X)                                                                          \
    X(fmi3SetDebugLogging, ANY_KIND, OUTSIDE_STEP)                                                 \
    X(fmi3EnterInitializationMode, ANY_KIND, INSTANTIATED)                                         \
    X(fmi3ExitInitializationMode, ANY_KIND, INITIALIZATION)                                        \
    X(fmi3EnterEventMode, EVENT_KINDS, STEP | CONTINUOUS_TIME)                                     \
    X(fmi3Terminate, ANY_KIND, STEP | EVENT | CONTINUOUS_TIME)                                     \
    X(fmi3Reset, ANY_KIND, OUTSIDE_STEP)                                                           \
    X(fmi3GetFloat32, ANY_KIND, ANY_STATE)                                                         \
    X(fmi3GetFloat64, ANY_KIND, ANY_STATE)                                                         \
    X(fmi3GetInt8, ANY_KIND, ANY_STATE)                                                            \
    X(fmi3GetUInt8, ANY_KIND, ANY_STATE)                                                           \
    X(fmi3GetInt16, ANY_KIND, ANY_STATE)                                                           \
    X(fmi3GetUInt16, ANY_KIND, ANY_STATE)                                                          \
    X(fmi3GetInt32, ANY_KIND, ANY_STATE)                                                           \
    X(fmi3GetUInt32, ANY_KIND, ANY_STATE)                                                          \
    X(fmi3GetInt64, ANY_KIND, ANY_STATE)                                                           \
    X(fmi3GetUInt64, ANY_KIND, ANY_STATE)                                                          \
    X(fmi3GetBoolean, ANY_KIND, ANY_STATE)                                                         \
    X(fmi3GetString, ANY_KIND, ANY_STATE)                                                          \
    X(fmi3GetBinary, ANY_KIND, ANY_STATE)                                                          \
    X(fmi3GetClock, ANY_KIND, EVENT)                                                               \
    X(fmi3SetFloat32, ANY_KIND, ANY_STATE & ~TERMINATED)                                           \
    X(fmi3SetFloat64, ANY_KIND, ANY_STATE & ~TERMINATED)                                           \
    X(fmi3SetInt8, ANY_KIND, ANY_STATE & ~TERMINATED)                                              \
    X(fmi3SetUInt8, ANY_KIND, ANY_STATE & ~TERMINATED)                                             \
    X(fmi3SetInt16, ANY_KIND, ANY_STATE & ~TERMINATED)                                             \
    X(fmi3SetUInt16, ANY_KIND, ANY_STATE & ~TERMINATED)                                            \
    X(fmi3SetInt32, ANY_KIND, ANY_STATE & ~TERMINATED)                                             \
    X(fmi3SetUInt32, ANY_KIND, ANY_STATE & ~TERMINATED)                                            \
    X(fmi3SetInt64, ANY_KIND, ANY_STATE & ~TERMINATED)                                             \
    X(fmi3SetUInt64, ANY_KIND, ANY_STATE & ~TERMINATED)                                            \
    X(fmi3SetBoolean, ANY_KIND, ANY_STATE & ~TERMINATED)                                           \
    X(fmi3SetString, ANY_KIND, ANY_STATE & ~TERMINATED)                                            \
    X(fmi3SetBinary, ANY_KIND, ANY_STATE & ~TERMINATED)                                            \
    X(fmi3SetClock, ANY_KIND, EVENT)                                                               \
    X(fmi3GetNumberOfVariableDependencies, ANY_KIND, ANY_STATE)                                    \
    X(fmi3GetVariableDependencies, ANY_KIND, ANY_STATE)                                            \
    X(fmi3GetFMUState, ANY_KIND, OUTSIDE_STEP)                                                     \
    X(fmi3SetFMUState, ANY_KIND, OUTSIDE_STEP)                                                     \
    X(fmi3FreeFMUState, ANY_KIND, OUTSIDE_STEP)                                                    \
    X(fmi3SerializedFMUStateSize, ANY_KIND, OUTSIDE_STEP)                                          \
    X(fmi3SerializeFMUState, ANY_KIND, OUTSIDE_STEP)                                               \
    X(fmi3DeserializeFMUState, ANY_KIND, OUTSIDE_STEP)                                             \
    X(fmi3GetDirectionalDerivative, ANY_KIND, OUTSIDE_STEP & ~INSTANTIATED)                        \
    X(fmi3GetAdjointDerivative, ANY_KIND, OUTSIDE_STEP & ~INSTANTIATED)                            \
    X(fmi3EnterConfigurationMode, ANY_KIND, INSTANTIATED | EVENT | STEP)                           \
    X(fmi3ExitConfigurationMode, ANY_KIND, 0)                                                      \
    X(fmi3GetIntervalDecimal, ANY_KIND, INITIALIZATION | EVENT)                                    \
    X(fmi3GetIntervalFraction, ANY_KIND, INITIALIZATION | EVENT)                                   \
    X(fmi3GetShiftDecimal, ANY_KIND, INITIALIZATION)                                               \
    X(fmi3GetShiftFraction, ANY_KIND, INITIALIZATION)                                              \
    X(fmi3SetIntervalDecimal, ANY_KIND, INITIALIZATION | EVENT)                                    \
    X(fmi3SetIntervalFraction, ANY_KIND, INITIALIZATION | EVENT)                                   \
    X(fmi3SetShiftDecimal, ANY_KIND, INITIALIZATION)                                               \
    X(fmi3SetShiftFraction, ANY_KIND, INITIALIZATION)                                              \
    X(fmi3EvaluateDiscreteStates, ANY_KIND, EVENT)                                                 \
    X(fmi3UpdateDiscreteStates, ANY_KIND, EVENT)                                                   \
    X(fmi3EnterContinuousTimeMode, MODEL_EXCHANGE, EVENT)                                          \
    X(fmi3CompletedIntegratorStep, MODEL_EXCHANGE, CONTINUOUS_TIME)                                \
    X(fmi3SetTime, MODEL_EXCHANGE, EVENT | CONTINUOUS_TIME)                                        \
    X(fmi3SetContinuousStates, MODEL_EXCHANGE, CONTINUOUS_TIME)                                    \
    X(fmi3GetContinuousStateDerivatives, MODEL_EXCHANGE, OUTSIDE_STEP & ~INSTANTIATED)             \
    X(fmi3GetEventIndicators, MODEL_EXCHANGE, OUTSIDE_STEP & ~INSTANTIATED)                        \
    X(fmi3GetContinuousStates, MODEL_EXCHANGE, OUTSIDE_STEP & ~INSTANTIATED)                       \
    X(fmi3GetNominalsOfContinuousStates, MODEL_EXCHANGE, ANY_STATE)                                \
    X(fmi3GetNumberOfEventIndicators, MODEL_EXCHANGE, ANY_STATE)                                   \
    X(fmi3GetNumberOfContinuousStates, MODEL_EXCHANGE, ANY_STATE)                                  \
    X(fmi3EnterStepMode, CO_SIMULATION_WITH_EVENTS, EVENT)                                         \
    X(fmi3GetOutputDerivatives, CO_SIMULATION, STEP | EVENT | INTERMEDIATE_UPDATE | TERMINATED)    \
    X(fmi3DoStep, CO_SIMULATION, STEP)                                                             \
    X(fmi3ActivateModelPartition, ANY_KIND, 0) /* only in Scheduled Execution */

#define FMI3_CALL_CODE(name, kinds, states) CALL_##name,
enum fmi3_call { FMI3_CALL_LIST(FMI3_CALL_CODE) FMI3_CALL_COUNT };
#undef FMI3_CALL_CODE

extern const struct call_rule fmi3_call_rules[FMI3_CALL_COUNT];

/* ---- Component ------------------------------------------------------------------------------ */

struct fmi3_component {
    struct component base;         /* first */
    fmi3LogMessageCallback logger; /* NULL for no log */
    fmi3InstanceEnvironment environment;

    /* Co-Simulation */
    fmi3IntermediateUpdateCallback update; /* NULL for no intermediate updates */
    bool early_return_allowed;
    bool asks_inputs; /* true if inputs are among the variables of intermediate updates */
    bool can_set;     /* true if inputs may be set in intermediate update mode */
    bool can_get;     /* true if values may be read in intermediate update mode */
    struct step_options options; /* options of every step */
    bool is_intermediate[];      /* by row of the table of variables: true if it was named for
                                    intermediate updates */
};

_Static_assert((int)COMPONENT_OK == fmi3OK && (int)COMPONENT_WARNING == fmi3Warning &&
                   (int)COMPONENT_DISCARD == fmi3Discard && (int)COMPONENT_ERROR == fmi3Error &&
                   (int)COMPONENT_FATAL == fmi3Fatal,
               "a component_status is converted by a cast");
_Static_assert(sizeof(int) == sizeof(fmi3Int32), "an fmi3Int32 is an int");

static inline fmi3Status fmi3_status(enum component_status status) {
    return (fmi3Status)status;
}

/* Returns true if the number of values is right; otherwise fails as component_fail. */
bool fmi3_check_count(struct component *component, enum fmi3_call call, size_t count,
                      size_t expected);

/* Returns true if the variables may be read or set in intermediate update mode; otherwise fails as
 * component_fail. Other modes are not checked here. */
bool fmi3_check_access(struct component *component, unsigned call, bool setting,
                       const fmi3ValueReference references[], size_t count);
