/* Which function of FMI 2.0 may be called in which state of a co-simulation slave: the table of
 * section 4.2.4 of the specification, as data. Functions that need no instance, and those that work
 * in every state (fmi2FreeInstance), are not in it. */
#ifndef CALLS_H
#define CALLS_H

/* One bit per state. */
enum fmi_state {
    STATE_INSTANTIATED = 1 << 0,
    STATE_INITIALIZATION = 1 << 1,
    STATE_STEP_COMPLETE = 1 << 2,
    STATE_STEP_FAILED = 1 << 3,
    STATE_TERMINATED = 1 << 4,
    STATE_ERROR = 1 << 5,
};

#define I STATE_INSTANTIATED
#define M STATE_INITIALIZATION
#define C STATE_STEP_COMPLETE
#define F STATE_STEP_FAILED
#define T STATE_TERMINATED
#define E STATE_ERROR

#define CALL_LIST(X)                                                                               \
    X(fmi2SetDebugLogging, I | M | C | F | T | E)                                                  \
    X(fmi2Reset, I | M | C | F | T | E)                                                            \
    X(fmi2SetupExperiment, I)                                                                      \
    X(fmi2EnterInitializationMode, I)                                                              \
    X(fmi2ExitInitializationMode, M)                                                               \
    X(fmi2Terminate, C | F)                                                                        \
    X(fmi2GetReal, M | C | F | T | E)                                                              \
    X(fmi2GetInteger, M | C | F | T | E)                                                           \
    X(fmi2GetBoolean, M | C | F | T | E)                                                           \
    X(fmi2GetString, M | C | F | T | E)                                                            \
    X(fmi2SetReal, I | M | C)                                                                      \
    X(fmi2SetInteger, I | M | C)                                                                   \
    X(fmi2SetBoolean, I | M | C)                                                                   \
    X(fmi2SetString, I | M | C)                                                                    \
    X(fmi2GetFMUstate, I | M | C | F | T | E)                                                      \
    X(fmi2SetFMUstate, I | M | C | F | T | E)                                                      \
    X(fmi2FreeFMUstate, I | M | C | F | T | E)                                                     \
    X(fmi2SerializedFMUstateSize, I | M | C | F | T | E)                                           \
    X(fmi2SerializeFMUstate, I | M | C | F | T | E)                                                \
    X(fmi2DeSerializeFMUstate, I | M | C | F | T | E)                                              \
    X(fmi2GetDirectionalDerivative, M | C | F | T | E)                                             \
    X(fmi2SetRealInputDerivatives, I | M | C)                                                      \
    X(fmi2GetRealOutputDerivatives, C | F | T | E)                                                 \
    X(fmi2DoStep, C)                                                                               \
    X(fmi2CancelStep, 0) /* only while a step is pending, and none ever is */                      \
    X(fmi2GetStatus, C | F | T)                                                                    \
    X(fmi2GetRealStatus, C | F | T)                                                                \
    X(fmi2GetIntegerStatus, C | F | T)                                                             \
    X(fmi2GetBooleanStatus, C | F | T)                                                             \
    X(fmi2GetStringStatus, C | F | T)                                                              \
    /* Model Exchange */                                                                           \
    X(fmi2EnterEventMode, 0)                                                                       \
    X(fmi2NewDiscreteStates, 0)                                                                    \
    X(fmi2EnterContinuousTimeMode, 0)                                                              \
    X(fmi2CompletedIntegratorStep, 0)                                                              \
    X(fmi2SetTime, 0)                                                                              \
    X(fmi2SetContinuousStates, 0)                                                                  \
    X(fmi2GetDerivatives, 0)                                                                       \
    X(fmi2GetEventIndicators, 0)                                                                   \
    X(fmi2GetContinuousStates, 0)                                                                  \
    X(fmi2GetNominalsOfContinuousStates, 0)

#define CALL_CODE(name, allowed) CALL_##name,
enum call { CALL_LIST(CALL_CODE) CALL_COUNT };
#undef CALL_CODE

struct call_rule {
    const char *name;
    unsigned allowed; /* bits of enum fmi_state */
};

#define CALL_RULE(name, allowed) [CALL_##name] = {#name, allowed},
static const struct call_rule call_rules[CALL_COUNT] = {CALL_LIST(CALL_RULE)};
#undef CALL_RULE

#undef I
#undef M
#undef C
#undef F
#undef T
#undef E

#endif
