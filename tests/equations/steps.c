/* Steps of an FMU for callgrind: steps LIBRARY GUID METHOD then value references of the method,
 * four states and two inputs. */
#include "fmi2FunctionTypes.h"

#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { STEPS = 300 };

static void write_log(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                      fmi2String category, fmi2String text, ...) {
    fprintf(stderr, "%s\n", text);
}

int main(int count, char *arguments[]) {
    void *library = count == 11 ? dlopen(arguments[1], RTLD_NOW) : NULL;
    if (library == NULL) {
        return 2;
    }
    unsigned references[7];
    for (int i = 0; i < 7; i++) {
        references[i] = (unsigned)atoi(arguments[4 + i]);
    }
    const int method = atoi(arguments[3]);
    const double start[] = {0.5, 0.2, -1.0, 0.3};
    const fmi2CallbackFunctions callbacks = {.logger = write_log};
    fmi2InstantiateTYPE *instantiate = (fmi2InstantiateTYPE *)dlsym(library, "fmi2Instantiate");
    fmi2SetRealTYPE *set = (fmi2SetRealTYPE *)dlsym(library, "fmi2SetReal");
    fmi2SetIntegerTYPE *choose = (fmi2SetIntegerTYPE *)dlsym(library, "fmi2SetInteger");
    fmi2SetupExperimentTYPE *setup =
        (fmi2SetupExperimentTYPE *)dlsym(library, "fmi2SetupExperiment");
    fmi2EnterInitializationModeTYPE *enter =
        (fmi2EnterInitializationModeTYPE *)dlsym(library, "fmi2EnterInitializationMode");
    fmi2ExitInitializationModeTYPE *leave =
        (fmi2ExitInitializationModeTYPE *)dlsym(library, "fmi2ExitInitializationMode");
    fmi2DoStepTYPE *step = (fmi2DoStepTYPE *)dlsym(library, "fmi2DoStep");
    fmi2Component c = instantiate("steps", fmi2CoSimulation, arguments[2], "", &callbacks, 0, 0);
    if (c == NULL || choose(c, references, 1, &method) != fmi2OK ||
        set(c, references + 1, 4, start) != fmi2OK ||
        setup(c, fmi2True, 1e-9, 0.0, fmi2False, 0.0) != fmi2OK || enter(c) != fmi2OK ||
        leave(c) != fmi2OK) {
        return 3;
    }
    for (int i = 0; i < STEPS; i++) {
        const double inputs[] = {3.0 * sin(0.01 * i), 8.0 + cos(0.02 * i)};
        if (set(c, references + 5, 2, inputs) != fmi2OK ||
            step(c, 0.01 * i, 0.01, fmi2True) != fmi2OK) {
            return 4;
        }
    }
    return 0;
}
