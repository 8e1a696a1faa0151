#include "fmu_version.h"

const unsigned fmu_version = 2;

void *fmu_version_open(struct fmu_functions *functions) {
    return fmu_library_open(FMU_LIBRARY, functions);
}

const char *fmu_name_of(enum fmu_function function) {
    return fmu_function_names[function];
}

static const struct fmi_state of_co_simulation[] = {
    {'I', "instantiated", FMU_SetupExperiment},
    {'M', "in initialization mode", FMU_ExitInitializationMode},
    {'C', "between steps", FMU_DoStep},
    {'F', "after a failed step", FMU_Terminate},
    {'T', "terminated", FMU_GetRealStatus},
    {'E', "in the error state", FMU_FUNCTION_COUNT},
};

static const struct fmi_state of_model_exchange[] = {
    {'I', "instantiated", FMU_SetupExperiment},
    {'M', "in initialization mode", FMU_ExitInitializationMode},
    {'V', "in event mode", FMU_EnterContinuousTimeMode},
    {'N', "in continuous-time mode", FMU_CompletedIntegratorStep},
    {'T', "terminated", FMU_FUNCTION_COUNT},
    {'E', "in the error state", FMU_FUNCTION_COUNT},
};

const struct fmi_states fmu_co_simulation_states = {6, of_co_simulation};
const struct fmi_states fmu_model_exchange_states = {6, of_model_exchange};
