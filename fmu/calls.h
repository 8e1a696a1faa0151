/* Which function of FMI 2.0 may be called in which state: the tables of section 3.2.3 (Model
 * Exchange) and section 4.2.4 (Co-Simulation) of the specification, as data. Functions that need no
 * instance, and fmi2FreeInstance, which works in every state, are not in it. */
#ifndef CALLS_H
#define CALLS_H

/* One bit per state. */
enum fmi_state {
    STATE_INSTANTIATED = 1 << 0,
    STATE_INITIALIZATION = 1 << 1,
    STATE_TERMINATED = 1 << 2,
    STATE_ERROR = 1 << 3,
    // Co-Simulation
    STATE_STEP_COMPLETE = 1 << 4,
    STATE_STEP_FAILED = 1 << 5,
    // Model Exchange
    STATE_EVENT = 1 << 6,
    STATE_CONTINUOUS_TIME = 1 << 7,
};

#define I   STATE_INSTANTIATED
#define M   STATE_INITIALIZATION
#define T   STATE_TERMINATED
#define E   STATE_ERROR
#define C   STATE_STEP_COMPLETE
#define F   STATE_STEP_FAILED
#define V   STATE_EVENT
#define N   STATE_CONTINUOUS_TIME
#define ALL (I | M | T | E | C | F | V | N)

#define CALL_LIST(X)                                                                               \
    X(fmi2SetDebugLogging, ANY_KIND, ALL)                                                          \
    X(fmi2Reset, ANY_KIND, ALL)                                                                    \
    X(fmi2SetupExperiment, ANY_KIND, I)                                                            \
    X(fmi2EnterInitializationMode, ANY_KIND, I)                                                    \
    X(fmi2ExitInitializationMode, ANY_KIND, M)                                                     \
    X(fmi2Terminate, ANY_KIND, C | F | V | N)                                                      \
    X(fmi2GetReal, ANY_KIND, M | T | E | C | F | V | N)                                            \
    X(fmi2GetInteger, ANY_KIND, M | T | E | C | F | V | N)                                         \
    X(fmi2GetBoolean, ANY_KIND, M | T | E | C | F | V | N)                                         \
    X(fmi2GetString, ANY_KIND, M | T | E | C | F | V | N)                                          \
    X(fmi2SetReal, ANY_KIND, I | M | C | V | N)                                                    \
    X(fmi2SetInteger, ANY_KIND, I | M | C | V)                                                     \
    X(fmi2SetBoolean, ANY_KIND, I | M | C | V)                                                     \
    X(fmi2SetString, ANY_KIND, I | M | C | V)                                                      \
    X(fmi2GetFMUstate, ANY_KIND, ALL)                                                              \
    X(fmi2SetFMUstate, ANY_KIND, ALL)                                                              \
    X(fmi2FreeFMUstate, ANY_KIND, ALL)                                                             \
    X(fmi2SerializedFMUstateSize, ANY_KIND, ALL)                                                   \
    X(fmi2SerializeFMUstate, ANY_KIND, ALL)                                                        \
    X(fmi2DeSerializeFMUstate, ANY_KIND, ALL)                                                      \
    X(fmi2GetDirectionalDerivative, ANY_KIND, M | T | E | C | F | V | N)                           \
    X(fmi2SetRealInputDerivatives, CO_SIMULATION, I | M | C)                                       \
    X(fmi2GetRealOutputDerivatives, CO_SIMULATION, T | E | C | F)                                  \
    X(fmi2DoStep, CO_SIMULATION, C)                                                                \
    X(fmi2CancelStep, CO_SIMULATION, 0) /* only while a step is pending: never */                  \
    X(fmi2GetStatus, CO_SIMULATION, T | C | F)                                                     \
    X(fmi2GetRealStatus, CO_SIMULATION, T | C | F)                                                 \
    X(fmi2GetIntegerStatus, CO_SIMULATION, T | C | F)                                              \
    X(fmi2GetBooleanStatus, CO_SIMULATION, T | C | F)                                              \
    X(fmi2GetStringStatus, CO_SIMULATION, T | C | F)                                               \
    X(fmi2EnterEventMode, MODEL_EXCHANGE, V | N)                                                   \
    X(fmi2NewDiscreteStates, MODEL_EXCHANGE, V)                                                    \
    X(fmi2EnterContinuousTimeMode, MODEL_EXCHANGE, V)                                              \
    X(fmi2CompletedIntegratorStep, MODEL_EXCHANGE, N)                                              \
    X(fmi2SetTime, MODEL_EXCHANGE, V | N)                                                          \
    X(fmi2SetContinuousStates, MODEL_EXCHANGE, N)                                                  \
    X(fmi2GetDerivatives, MODEL_EXCHANGE, T | E | V | N)                                           \
    X(fmi2GetEventIndicators, MODEL_EXCHANGE, M | T | E | V | N)                                   \
    X(fmi2GetContinuousStates, MODEL_EXCHANGE, M | T | E | V | N)                                  \
    X(fmi2GetNominalsOfContinuousStates, MODEL_EXCHANGE, I | T | E | V | N)

/* The kind of instance that a call belongs to. */
enum call_kind { ANY_KIND, CO_SIMULATION, MODEL_EXCHANGE };

#define CALL_CODE(name, kind, allowed) CALL_##name,
enum call { CALL_LIST(CALL_CODE) CALL_COUNT };
#undef CALL_CODE

struct call_rule {
    const char *name;
    enum call_kind kind;
    unsigned allowed; /* bits of enum fmi_state */
};

#define CALL_RULE(name, kind, allowed) [CALL_##name] = {#name, kind, allowed},
static const struct call_rule call_rules[CALL_COUNT] = {CALL_LIST(CALL_RULE)};
#undef CALL_RULE

#undef I
#undef M
#undef T
#undef E
#undef C
#undef F
#undef V
#undef N
#undef ALL

#endif
