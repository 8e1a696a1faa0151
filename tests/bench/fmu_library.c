#include "fmu_library.h"

#include <dlfcn.h>
#include <stdio.h>
#include <string.h>

/* As POSIX has it: a function pointer is the bytes of the object pointer that dlsym returns. */
static bool find(void *handle, const char *name, void *function) {
    void *symbol = dlsym(handle, name);
    memcpy(function, &symbol, sizeof symbol);
    if (symbol == NULL) {
        fprintf(stderr, "%s\n", dlerror());
    }
    return symbol != NULL;
}

bool fmu_library_open(const char *path, struct fmu_library *library) {
    void *handle = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    library->handle = handle;
    if (handle == NULL) {
        fprintf(stderr, "%s\n", dlerror());
        return false;
    }
    return find(handle, "fmi2Instantiate", &library->instantiate) &&
           find(handle, "fmi2FreeInstance", &library->free_instance) &&
           find(handle, "fmi2SetupExperiment", &library->setup_experiment) &&
           find(handle, "fmi2EnterInitializationMode", &library->enter_initialization) &&
           find(handle, "fmi2ExitInitializationMode", &library->exit_initialization) &&
           find(handle, "fmi2SetReal", &library->set_real) &&
           find(handle, "fmi2GetReal", &library->get_real) &&
           find(handle, "fmi2SetInteger", &library->set_integer) &&
           find(handle, "fmi2GetInteger", &library->get_integer) &&
           find(handle, "fmi2DoStep", &library->do_step);
}

void fmu_library_close(struct fmu_library *library) {
    dlclose(library->handle);
}
