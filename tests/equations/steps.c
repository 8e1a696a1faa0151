/* Steps of an FMU for callgrind: steps LIBRARY GUID METHOD then value references of the method,
 * four states and two inputs. */
#include "fmu_library.h"

#include <math.h>
#include <stdlib.h>

int main(int count, char *arguments[]) {
    struct fmu_functions fmi;
    if (count != 11 || fmu_library_open(arguments[1], &fmi) == NULL) {
        return 2;
    }
    unsigned references[7];
    for (int i = 0; i < 7; i++) {
        references[i] = (unsigned)atoi(arguments[4 + i]);
    }
    const int method = atoi(arguments[3]);
    const double start[] = {0.5, 0.2, -1.0, 0.3};
    const fmi2CallbackFunctions callbacks = {0};
    fmi2Component c =
        fmi.Instantiate("steps", fmi2CoSimulation, arguments[2], "", &callbacks, 0, 0);
    int failed =
        fmi.SetInteger(c, references, 1, &method) | fmi.SetReal(c, references + 1, 4, start);
    failed |= fmi.SetupExperiment(c, fmi2True, 1e-9, 0.0, fmi2False, 0.0);
    failed |= fmi.EnterInitializationMode(c) | fmi.ExitInitializationMode(c);
    for (int i = 0; i < 300; i++) {
        const double inputs[] = {3.0 * sin(0.01 * i), 8.0 + cos(0.02 * i)};
        failed |= fmi.SetReal(c, references + 5, 2, inputs);
        failed |= fmi.DoStep(c, 0.01 * i, 0.01, fmi2True);
    }
    return failed;
}
