#include "fmu_library.h"

#include "fmu3_library.h"

#include <dlfcn.h>
#include <stdio.h>
#include <string.h>

#define FMU_NAME(name, kinds, states) "fmi2" #name,
const char *const fmu_function_names[FMU_FUNCTION_COUNT] = {FMI2_FUNCTION_LIST(FMU_NAME)};
#undef FMU_NAME

void *fmu_library_load(const char *path, const char *const names[], const size_t offsets[],
                       size_t count, void *functions) {
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) {
        fprintf(stderr, "%s\n", dlerror());
        return NULL;
    }
    for (size_t i = 0; i < count; i++) {
        void *symbol = dlsym(library, names[i]);
        if (symbol == NULL) {
            fprintf(stderr, "%s\n", dlerror());
            dlclose(library);
            return NULL;
        }
        // as POSIX has it: a function pointer is the bytes of the object pointer
        memcpy((char *)functions + offsets[i], &symbol, sizeof symbol);
    }
    return library;
}

void *fmu_library_open(const char *path, struct fmu_functions *functions) {
#define FMU_OFFSET(name, kinds, states) offsetof(struct fmu_functions, name),
    static const size_t offsets[FMU_FUNCTION_COUNT] = {FMI2_FUNCTION_LIST(FMU_OFFSET)};
#undef FMU_OFFSET
    return fmu_library_load(path, fmu_function_names, offsets, FMU_FUNCTION_COUNT, functions);
}

#define FMU3_NAME(name, kinds, states) "fmi3" #name,
const char *const fmu3_function_names[FMU3_FUNCTION_COUNT] = {FMI3_FUNCTION_LIST(FMU3_NAME)};
#undef FMU3_NAME

void *fmu3_library_open(const char *path, struct fmu3_functions *functions) {
#define FMU3_OFFSET(name, kinds, states) offsetof(struct fmu3_functions, name),
    static const size_t offsets[FMU3_FUNCTION_COUNT] = {FMI3_FUNCTION_LIST(FMU3_OFFSET)};
#undef FMU3_OFFSET
    return fmu_library_load(path, fmu3_function_names, offsets, FMU3_FUNCTION_COUNT, functions);
}

bool fmu_is_harmless(const char *text, const char *doubled) {
    if (text == NULL || text[0] == '\0') {
        return false;
    }
    for (; *text != '\0'; text++) {
        if (strchr(doubled, *text) != NULL && *text != *(text + 1)) {
            return false;
        }
        text += strchr(doubled, *text) != NULL;
    }
    return true;
}
