#include "fmi2_calls.h"

#define INSTANTIATED    STATE_INSTANTIATED
#define INITIALIZATION  STATE_INITIALIZATION
#define TERMINATED      STATE_TERMINATED
#define ERROR_STATE     STATE_ERROR
#define STEP_COMPLETE   STATE_STEP_COMPLETE
#define STEP_FAILED     STATE_STEP_FAILED
#define EVENT           STATE_EVENT
#define CONTINUOUS_TIME STATE_CONTINUOUS_TIME
#define ANY_STATE                                                                                  \
    (INSTANTIATED | INITIALIZATION | TERMINATED | ERROR_STATE | STEP_COMPLETE | STEP_FAILED |      \
     EVENT | CONTINUOUS_TIME)

#define MODEL_EXCHANGE KIND_MODEL_EXCHANGE
#define CO_SIMULATION  KIND_CO_SIMULATION
#define ANY_KIND       (MODEL_EXCHANGE | CO_SIMULATION)

#define FMI2_CALL_RULE(name, kinds, states) [CALL_fmi2##name] = {"fmi2" #name, kinds, states},
const struct call_rule fmi2_call_rules[FMI2_CALL_COUNT] = {FMI2_FUNCTION_LIST(FMI2_CALL_RULE)};
