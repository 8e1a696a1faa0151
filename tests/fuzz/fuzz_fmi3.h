/* Calls of FMI 3.0 that have no counterpart in FMI 2.0. */
#ifndef FUZZ_FMI3_H
#define FUZZ_FMI3_H

#include "fmu_fmi3.h"
#include "fuzz_instance.h"

#include <fmi3Functions.h>

#define FUZZ_FMI3_CALL(instance, works_in_error, name, ...)                                        \
    fuzz_check_call(                                                                               \
        instance, "fmi3" #name, works_in_error,                                                    \
        (fmi2Status)FUZZ_CALL(fmi3##name(fmu_fmi3_instance((instance)->component), __VA_ARGS__)))
#define FUZZ_FMI3_CHECKED(instance, name, ...) FUZZ_FMI3_CALL(instance, false, name, __VA_ARGS__)
#define FUZZ_FMI3_CHECKED_PLAIN(instance, name)                                                    \
    fuzz_check_call(instance, "fmi3" #name, false,                                                 \
                    (fmi2Status)FUZZ_CALL(fmi3##name(fmu_fmi3_instance((instance)->component))))

#endif
