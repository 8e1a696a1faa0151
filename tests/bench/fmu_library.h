/* The functions of an FMU that the benchmark calls, from its shared object. */
#ifndef FMU_LIBRARY_H
#define FMU_LIBRARY_H

#include "value_references.h"

#include "fmi2FunctionTypes.h"

#include <stdbool.h>

struct fmu_library {
    void *handle;
    fmi2InstantiateTYPE *instantiate;
    fmi2FreeInstanceTYPE *free_instance;
    fmi2SetupExperimentTYPE *setup_experiment;
    fmi2EnterInitializationModeTYPE *enter_initialization;
    fmi2ExitInitializationModeTYPE *exit_initialization;
    fmi2SetRealTYPE *set_real;
    fmi2GetRealTYPE *get_real;
    fmi2SetIntegerTYPE *set_integer;
    fmi2GetIntegerTYPE *get_integer;
    fmi2DoStepTYPE *do_step;
};

/* False, with a line on stderr, where the object or a function of it is not found. */
bool fmu_library_open(const char *path, struct fmu_library *library);
void fmu_library_close(struct fmu_library *library);

#endif
