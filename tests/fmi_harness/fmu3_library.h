/* An FMU of FMI 3.0: its shared object and the functions of the standard header in it. */
#ifndef FMU3_LIBRARY_H
#define FMU3_LIBRARY_H

#include "fmi3_functions.h"

#include <stdbool.h>
#include <stddef.h>

#include <fmi3FunctionTypes.h>

#define FMU3_CODE(name, kinds, states) FMU3_##name,
enum fmu3_function { FMI3_FUNCTION_LIST(FMU3_CODE) FMU3_FUNCTION_COUNT };
#undef FMU3_CODE

#define FMU3_POINTER(name, kinds, states) fmi3##name##TYPE *name;
struct fmu3_functions {
    FMI3_FUNCTION_LIST(FMU3_POINTER)
};
#undef FMU3_POINTER

/* As the standard spells it: "fmi3GetFloat64". */
extern const char *const fmu3_function_names[FMU3_FUNCTION_COUNT];

/* As fmu_library_open. */
void *fmu3_library_open(const char *path, struct fmu3_functions *functions);

#endif
