/* Runs the arm by FMI 3.0 with nothing but the standard's headers: it falls from the horizontal
 * while a torque holds it back. Prints time in s, q1 in rad and q2 in m as CSV.
 *
 *     unzip -d arm build/fmi3/RPManipulator.fmu
 *     cc -I HEADERS examples/fmi3_importer.c -o importer -ldl -lm && ./importer arm
 */

#include <dlfcn.h>
#include <fmi3Functions.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define STEP  0.01 /* s */
#define STEPS 100

enum { M2 = 2, Q1 = 10, Q2 = 11, TAU1 = 20, F2 = 21 }; /* value references, of the model's page */

/* Functions that are called; fmi3FunctionTypes.h has their types. */
static struct {
    fmi3InstantiateCoSimulationTYPE *instantiate;
    fmi3EnterInitializationModeTYPE *enter_initialization_mode;
    fmi3ExitInitializationModeTYPE *exit_initialization_mode;
    fmi3SetFloat64TYPE *set;
    fmi3GetFloat64TYPE *get;
    fmi3DoStepTYPE *do_step;
    fmi3TerminateTYPE *terminate;
    fmi3FreeInstanceTYPE *free_instance;
} fmu;

static void fail(const char *reason) {
    fprintf(stderr, "fmi3_importer: %s\n", reason);
    exit(EXIT_FAILURE);
}

static void check(fmi3Status status, const char *call) {
    if (status != fmi3OK) {
        fail(call);
    }
}

static void print_message(fmi3InstanceEnvironment environment, fmi3Status status,
                          fmi3String category, fmi3String text) {
    (void)environment, (void)status;
    fprintf(stderr, "%s: %s\n", category, text);
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
    snprintf(path, sizeof path, "%s/binaries/x86_64-linux/RPManipulator.so", folder);
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) {
        fail(dlerror());
    }
    *(void **)&fmu.instantiate = loaded(library, "fmi3InstantiateCoSimulation");
    *(void **)&fmu.enter_initialization_mode = loaded(library, "fmi3EnterInitializationMode");
    *(void **)&fmu.exit_initialization_mode = loaded(library, "fmi3ExitInitializationMode");
    *(void **)&fmu.set = loaded(library, "fmi3SetFloat64");
    *(void **)&fmu.get = loaded(library, "fmi3GetFloat64");
    *(void **)&fmu.do_step = loaded(library, "fmi3DoStep");
    *(void **)&fmu.terminate = loaded(library, "fmi3Terminate");
    *(void **)&fmu.free_instance = loaded(library, "fmi3FreeInstance");
}

/* The token ties a model description to its library. */
static void read_token(const char *folder, char token[64]) {
    static char text[1 << 16];
    snprintf(text, sizeof text, "%s/modelDescription.xml", folder);
    FILE *file = fopen(text, "r");
    if (file == NULL) {
        fail("no modelDescription.xml there");
    }
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    const char *found = strstr(text, "instantiationToken=\"");
    if (found == NULL || sscanf(found, "instantiationToken=\"%63[^\"]", token) != 1) {
        fail("no token in modelDescription.xml");
    }
}

int main(int argc, char **argv) {
    if (argc != 2) {
        fail("usage: fmi3_importer FOLDER_OF_THE_UNPACKED_FMU");
    }
    char token[64];
    load(argv[1]);
    read_token(argv[1], token);

    fmi3Instance arm = fmu.instantiate("arm", token, NULL, fmi3False, fmi3False, fmi3False,
                                       fmi3False, NULL, 0, NULL, print_message, NULL);
    if (arm == NULL) {
        fail("fmi3InstantiateCoSimulation");
    }
    check(fmu.set(arm, (const fmi3ValueReference[]){M2}, 1, (const double[]){1.2}, 1),
          "fmi3SetFloat64");
    check(fmu.enter_initialization_mode(arm, fmi3True, 1e-8, 0.0, fmi3True, STEPS * STEP),
          "fmi3EnterInitializationMode");
    check(fmu.exit_initialization_mode(arm), "fmi3ExitInitializationMode");

    printf("time,q1,q2\n");
    for (int i = 0; i <= STEPS; i++) {
        const fmi3ValueReference inputs[] = {TAU1, F2}, outputs[] = {Q1, Q2};
        const double time = i * STEP, efforts[] = {15.0 * cos(time), -2.0};
        fmi3Boolean event, terminate, early;
        fmi3Float64 reached;
        double q[2];
        check(fmu.get(arm, outputs, 2, q, 2), "fmi3GetFloat64");
        printf("%.17g,%.17g,%.17g\n", time, q[0], q[1]);
        if (i < STEPS) {
            check(fmu.set(arm, inputs, 2, efforts, 2), "fmi3SetFloat64");
            check(fmu.do_step(arm, time, STEP, fmi3True, &event, &terminate, &early, &reached),
                  "fmi3DoStep");
        }
    }
    check(fmu.terminate(arm), "fmi3Terminate");
    fmu.free_instance(arm);
    return EXIT_SUCCESS;
}
