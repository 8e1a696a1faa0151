/* Stands before the arm's shared object, and takes its process down in the steps with m2 = 3. */
#define _GNU_SOURCE // RTLD_NEXT

#include <dlfcn.h>
#include <stdlib.h>

#include "fmi2Functions.h"

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real time, fmi2Real step, fmi2Boolean last) {
    const fmi2ValueReference m2 = M2;
    fmi2Real mass = 3.0;
    fmi2DoStepTYPE *next;
    *(void **)&next = dlsym(RTLD_NEXT, "fmi2DoStep");
    if (next == NULL || fmi2GetReal(component, &m2, 1, &mass) != fmi2OK || mass == 3.0) {
        abort();
    }
    return next(component, time, step, last);
}
