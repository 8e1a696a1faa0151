/* What instances of FMI 3.0 have besides what the functions of FMI 2.0 ask for: fmu_fmi3.c. */
#ifndef FMU_FMI3_H
#define FMU_FMI3_H

#include "fmu3_library.h"
#include "fmu_library.h"

/* Of instances for Co-Simulation made from now on; none by default. */
struct fmu_fmi3_options {
    bool event_mode; /* the end of initialization leads to step mode all the same */
    bool early_return;
    fmi3IntermediateUpdateCallback update; /* gets the environment of the component */
    const fmi3ValueReference *required;    /* variables of intermediate updates */
    size_t required_count;
};
extern struct fmu_fmi3_options fmu_fmi3_options;

/* Functions of the loaded FMU. */
extern struct fmu3_functions fmu3;

/* The instance behind a component. */
fmi3Instance fmu_fmi3_instance(fmi2Component c);

#endif
