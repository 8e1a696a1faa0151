/* Which function of FMI 2.0 may be called in which state: the rules of fmi2_functions.h. */
#ifndef FMI2_CALLS_H
#define FMI2_CALLS_H

#include "calls.h"
#include "fmi2_functions.h"

#define FMI2_CALL_CODE(name, kinds, states) CALL_fmi2##name,
enum fmi2_call { FMI2_FUNCTION_LIST(FMI2_CALL_CODE) FMI2_CALL_COUNT };
#undef FMI2_CALL_CODE

extern const struct call_rule fmi2_call_rules[FMI2_CALL_COUNT];

#endif
