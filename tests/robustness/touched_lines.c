/* A step of RPManipulator for valgrind's lackey, which lists what a program reads and writes:
 *
 *     touched_lines LIBRARY METHOD
 *         prints the address of a byte that is written before and after the last step, and where
 *         the heap begins and ends */
#define _DEFAULT_SOURCE // sbrk

#include "fmu_library.h"
#include "value_references.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include <unistd.h>

enum { STEPS = 10 };

static const double step_size = 1e-3; /* s */
static volatile char mark;

static bool is_stepped(const struct fmu_functions *fmu, fmi2Component c, int i) {
    static const fmi2ValueReference inputs[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2};
    static const fmi2ValueReference outputs[] = {RP_MANIPULATOR_q1, RP_MANIPULATOR_q2,
                                                 RP_MANIPULATOR_dq1, RP_MANIPULATOR_dq2};
    const double t = i * step_size;
    const double u[] = {12.0 + 3.0 * sin(5.0 * t), 4.0 + 2.0 * cos(7.0 * t)};
    double x[4];
    mark = 1;
    const bool is_done = fmu->SetReal(c, inputs, 2, u) == fmi2OK &&
                         fmu->DoStep(c, t, step_size, fmi2True) == fmi2OK &&
                         fmu->GetReal(c, outputs, 4, x) == fmi2OK;
    mark = 0;
    return is_done;
}

int main(int count, char **arguments) {
    static const fmi2CallbackFunctions callbacks = {0};
    static const fmi2ValueReference solver_method = RP_MANIPULATOR_solver_method;
    const void *begin = sbrk(0);
    struct fmu_functions fmu;
    if (count != 3 || fmu_library_open(arguments[1], &fmu) == NULL) {
        return 2;
    }
    const fmi2Integer method = (fmi2Integer)strtol(arguments[2], NULL, 10);
    const fmi2Component c = fmu.Instantiate("touched_lines", fmi2CoSimulation, RP_MANIPULATOR_GUID,
                                            NULL, &callbacks, fmi2False, fmi2False);
    if (c == NULL || fmu.SetInteger(c, &solver_method, 1, &method) != fmi2OK ||
        fmu.SetupExperiment(c, fmi2True, 1e-8, 0.0, fmi2False, 0.0) != fmi2OK ||
        fmu.EnterInitializationMode(c) != fmi2OK || fmu.ExitInitializationMode(c) != fmi2OK) {
        return 3;
    }
    for (int i = 0; i < STEPS; i++) {
        if (!is_stepped(&fmu, c, i)) {
            return 4;
        }
    }
    const void *end = sbrk(0);
    fmu.FreeInstance(c);
    printf("%p %p %p\n", (const void *)&mark, begin, end);
    return 0;
}
