/* A built FMU's shared object and the functions of the standard header in it, as importers load
 * them. */
#ifndef FMU_LIBRARY_H
#define FMU_LIBRARY_H

#include "fmi2_functions.h"

#include <stdbool.h>
#include <stddef.h>

#include <fmi2TypesPlatform.h>

#include <fmi2FunctionTypes.h>

#define FMU_CODE(name, kinds, states) FMU_##name,
enum fmu_function { FMI2_FUNCTION_LIST(FMU_CODE) FMU_FUNCTION_COUNT };
#undef FMU_CODE

#define FMU_POINTER(name, kinds, states) fmi2##name##TYPE *name;
struct fmu_functions {
    FMI2_FUNCTION_LIST(FMU_POINTER)
};
#undef FMU_POINTER

/* As the standard spells it: "fmi2GetReal". */
extern const char *const fmu_function_names[FMU_FUNCTION_COUNT];

/* Handle of the shared object at path, for dlclose, with its functions of these names at their
 * offsets in a structure. NULL, with a line on stderr, where it or one of them is not found. */
void *fmu_library_load(const char *path, const char *const names[], const size_t offsets[],
                       size_t count, void *functions);

/* Handle of the shared object at path, for dlclose. NULL, with a line on stderr, where it or one of
 * the functions is not found. */
void *fmu_library_open(const char *path, struct fmu_functions *functions);

/* Importers resolve variables named as #r<reference># in a message, and in FMI 2.0 pass it to
 * printf (section 2.1.5): false where it is NULL or empty, or one of the characters that mean
 * something to them is not doubled. */
bool fmu_is_harmless(const char *text, const char *doubled);

#endif
