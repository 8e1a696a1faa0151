/* Runs the arm by FMI 2.0 with nothing but the standard's headers: it falls from the horizontal
 * while a torque holds it back. Prints time in s, q1 in rad and q2 in m as CSV.
 *
 *     unzip -d arm build/RPManipulator.fmu
 *     cc -I HEADERS examples/fmi2_importer.c -o importer -ldl -lm && ./importer arm
 */

#include <dlfcn.h>
#include <fmi2Functions.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define STEP  0.01 /* s */
#define STEPS 100

enum { M2 = 2, Q1 = 10, Q2 = 11, TAU1 = 20, F2 = 21 }; /* value references, of the model's page */

/* Functions that are called; fmi2FunctionTypes.h has their types. */
static struct {
    fmi2InstantiateTYPE *instantiate;
    fmi2SetupExperimentTYPE *setup_experiment;
    fmi2EnterInitializationModeTYPE *enter_initialization_mode;
    fmi2ExitInitializationModeTYPE *exit_initialization_mode;
    fmi2SetRealTYPE *set_real;
    fmi2GetRealTYPE *get_real;
    fmi2DoStepTYPE *do_step;
    fmi2TerminateTYPE *terminate;
    fmi2FreeInstanceTYPE *free_instance;
} fmu;

static void fail(const char *reason) {
    fprintf(stderr, "fmi2_importer: %s\n", reason);
    exit(EXIT_FAILURE);
}

static void check(fmi2Status status, const char *call) {
    if (status != fmi2OK) {
        fail(call);
    }
}

static void print_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                          fmi2String category, fmi2String text, ...) {
    va_list arguments;
    va_start(arguments, text);
    (void)environment, (void)status;
    fprintf(stderr, "%s (%s): ", name, category);
    vfprintf(stderr, text, arguments);
    fputc('\n', stderr);
    va_end(arguments);
}

static void *loaded(void *library, const char *name) {
    void *function = dlsym(library, name);
    if (function == NULL) {
        fail(name);
    }
    return function;
}

static void load(const char *folder) {
    char path[4096];
    snprintf(path, sizeof path, "%s/binaries/linux64/RPManipulator.so", folder);
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) {
        fail(dlerror());
    }
    *(void **)&fmu.instantiate = loaded(library, "fmi2Instantiate");
    *(void **)&fmu.setup_experiment = loaded(library, "fmi2SetupExperiment");
    *(void **)&fmu.enter_initialization_mode = loaded(library, "fmi2EnterInitializationMode");
    *(void **)&fmu.exit_initialization_mode = loaded(library, "fmi2ExitInitializationMode");
    *(void **)&fmu.set_real = loaded(library, "fmi2SetReal");
    *(void **)&fmu.get_real = loaded(library, "fmi2GetReal");
    *(void **)&fmu.do_step = loaded(library, "fmi2DoStep");
    *(void **)&fmu.terminate = loaded(library, "fmi2Terminate");
    *(void **)&fmu.free_instance = loaded(library, "fmi2FreeInstance");
}

/* The GUID ties a model description to its library. */
static void read_guid(const char *folder, char guid[64]) {
    static char text[1 << 16];
    snprintf(text, sizeof text, "%s/modelDescription.xml", folder);
    FILE *file = fopen(text, "r");
    if (file == NULL) {
        fail("no modelDescription.xml there");
    }
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    const char *found = strstr(text, "guid=\"");
    if (found == NULL || sscanf(found, "guid=\"%63[^\"]", guid) != 1) {
        fail("no GUID in modelDescription.xml");
    }
}

int main(int argc, char **argv) {
    if (argc != 2) {
        fail("usage: fmi2_importer FOLDER_OF_THE_UNPACKED_FMU");
    }
    char guid[64];
    load(argv[1]);
    read_guid(argv[1], guid);

    const fmi2CallbackFunctions callbacks = {print_message, calloc, free, NULL, NULL};
    fmi2Component arm =
        fmu.instantiate("arm", fmi2CoSimulation, guid, "", &callbacks, fmi2False, fmi2False);
    if (arm == NULL) {
        fail("fmi2Instantiate");
    }
    check(fmu.setup_experiment(arm, fmi2True, 1e-8, 0.0, fmi2True, STEPS * STEP),
          "fmi2SetupExperiment");
    check(fmu.set_real(arm, (const fmi2ValueReference[]){M2}, 1, (const double[]){1.2}),
          "fmi2SetReal");
    check(fmu.enter_initialization_mode(arm), "fmi2EnterInitializationMode");
    check(fmu.exit_initialization_mode(arm), "fmi2ExitInitializationMode");

    printf("time,q1,q2\n");
    for (int i = 0; i <= STEPS; i++) {
        const fmi2ValueReference inputs[] = {TAU1, F2}, outputs[] = {Q1, Q2};
        const double time = i * STEP, efforts[] = {15.0 * cos(time), -2.0};
        double q[2];
        check(fmu.get_real(arm, outputs, 2, q), "fmi2GetReal");
        printf("%.17g,%.17g,%.17g\n", time, q[0], q[1]);
        if (i < STEPS) {
            check(fmu.set_real(arm, inputs, 2, efforts), "fmi2SetReal");
            check(fmu.do_step(arm, time, STEP, fmi2True), "fmi2DoStep");
        }
    }
    check(fmu.terminate(arm), "fmi2Terminate");
    fmu.free_instance(arm);
    return EXIT_SUCCESS;
}
