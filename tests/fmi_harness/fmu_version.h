/* The version of FMI whose FMU the tests of a program load. All of them call the functions of FMI
 * 2.0; where the FMU is one of FMI 3.0, each of these is a call, or some calls, of that version
 * with the same meaning. Defined once for each version: fmu_fmi2.c, fmu_fmi3.c. */
#ifndef FMU_VERSION_H
#define FMU_VERSION_H

#include "fmu_library.h"

extern const unsigned fmu_version; /* 2 or 3 */

/* Opens the FMU of this build; NULL, with a line on stderr, where it cannot be used. */
void *fmu_version_open(struct fmu_functions *functions);

/* The name by which messages of the FMU call a function. */
const char *fmu_name_of(enum fmu_function function);

/* ---- States --------------------------------------------------------------------------------- */

struct fmi_state {
    char letter;
    const char *name;        /* as messages put it */
    enum fmu_function proof; /* works here, but not after an error */
};

struct fmi_states {
    size_t count;
    const struct fmi_state *states;
};

extern const struct fmi_states fmu_co_simulation_states;
extern const struct fmi_states fmu_model_exchange_states;

#endif
