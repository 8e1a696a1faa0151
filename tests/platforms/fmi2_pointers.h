/* The functions of FMI 2.0 in a loaded library. */
#ifndef FMI2_POINTERS_H
#define FMI2_POINTERS_H

#include "fmi2_functions.h"

#include <stdbool.h>
#include <stddef.h>

#include <fmi2TypesPlatform.h>

#include <fmi2FunctionTypes.h>

#define FMI2_MEMBER(name, kinds, states) fmi2##name##TYPE *name;
struct fmi2_functions {
    FMI2_FUNCTION_LIST(FMI2_MEMBER)
};
#undef FMI2_MEMBER

#endif
