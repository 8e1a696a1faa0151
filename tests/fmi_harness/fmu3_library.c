#include "fmu3_library.h"

#include "fmu_library.h"

#define FMU3_NAME(name) "fmi3" #name,
const char *const fmu3_function_names[FMU3_FUNCTION_COUNT] = {FMU3_FUNCTION_LIST(FMU3_NAME)};
#undef FMU3_NAME

void *fmu3_library_open(const char *path, struct fmu3_functions *functions) {
#define FMU3_OFFSET(name) offsetof(struct fmu3_functions, name),
    static const size_t offsets[FMU3_FUNCTION_COUNT] = {FMU3_FUNCTION_LIST(FMU3_OFFSET)};
#undef FMU3_OFFSET
    return fmu_library_load(path, fmu3_function_names, offsets, FMU3_FUNCTION_COUNT, functions);
}
