/* The runs of a campaign by a plain loop in C, with FMI 2.0: what the campaign's rate is compared
 * with.
 *
 * c_loop RUNS THREADS RESULTS: each thread has one instance of each FMU and resets it between runs.
 * Components step in Jacobi order. Prints seconds of wall time and of processor time; of each run
 * the last and the largest of all values that are read go to the file RESULTS, as doubles.
 *
 * c_loop.py writes work.h: the FMUs, what is set, connections and points.
 */
#define _POSIX_C_SOURCE 200809L

#include <dlfcn.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2Functions.h"

struct real {
    int component;
    fmi2ValueReference reference;
    double value;
};

struct integer {
    int component;
    fmi2ValueReference reference;
    int value; /* of an Integer, an enumeration or a Boolean */
};

#define LENGTH(array) ((int)(sizeof(array) / sizeof((array)[0])))

#include "work.h"

enum {
    COMPONENTS = LENGTH(libraries),
    RUNS = LENGTH(points),
    STEPS = LENGTH(times) - 1,
    HELD = LENGTH(held) / (STEPS + 1), /* inputs that are held over a step */
    INPUTS = LENGTH(inputs),
    OUTPUTS = LENGTH(outputs),
    MAX_THREADS = 64
};

static struct {
    fmi2InstantiateTYPE *instantiate;
    fmi2FreeInstanceTYPE *free_instance;
    fmi2ResetTYPE *reset;
    fmi2SetupExperimentTYPE *setup;
    fmi2EnterInitializationModeTYPE *enter;
    fmi2ExitInitializationModeTYPE *leave;
    fmi2SetRealTYPE *set_real;
    fmi2GetRealTYPE *get_real;
    fmi2SetIntegerTYPE *set_integer;
    fmi2SetBooleanTYPE *set_boolean;
    fmi2DoStepTYPE *do_step;
} fmus[COMPONENTS];

static double results[RUNS][2][OUTPUTS];

struct work {
    pthread_t thread;
    int first, behind; /* runs */
    int failed;
};

static void ignore(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                   fmi2String category, fmi2String message, ...) {}

static void *find(void *library, const char *name) {
    void *function = dlsym(library, name);
    if (function == NULL) {
        fprintf(stderr, "c_loop: no %s\n", name);
        exit(2);
    }
    return function;
}

static void load(int c) {
    void *library = dlopen(libraries[c], RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) {
        fprintf(stderr, "c_loop: %s\n", dlerror());
        exit(2);
    }
    *(void **)&fmus[c].instantiate = find(library, "fmi2Instantiate");
    *(void **)&fmus[c].free_instance = find(library, "fmi2FreeInstance");
    *(void **)&fmus[c].reset = find(library, "fmi2Reset");
    *(void **)&fmus[c].setup = find(library, "fmi2SetupExperiment");
    *(void **)&fmus[c].enter = find(library, "fmi2EnterInitializationMode");
    *(void **)&fmus[c].leave = find(library, "fmi2ExitInitializationMode");
    *(void **)&fmus[c].set_real = find(library, "fmi2SetReal");
    *(void **)&fmus[c].get_real = find(library, "fmi2GetReal");
    *(void **)&fmus[c].set_integer = find(library, "fmi2SetInteger");
    *(void **)&fmus[c].set_boolean = find(library, "fmi2SetBoolean");
    *(void **)&fmus[c].do_step = find(library, "fmi2DoStep");
}

/* values: first what is held, then what is read of each component. */
static int set_inputs(fmi2Component *instances, const double *values) {
    double to_set[INPUTS + 1];
    int failed = 0;
    for (int c = 0; c < COMPONENTS; c++) {
        const int begin = first_input[c], count = first_input[c + 1] - begin;
        if (count == 0) {
            continue;
        }
        for (int k = 0; k < count; k++) {
            to_set[k] = values[sources[begin + k]];
        }
        failed |= fmus[c].set_real(instances[c], inputs + begin, (size_t)count, to_set) != fmi2OK;
    }
    return failed;
}

static int read_outputs(fmi2Component *instances, double *values) {
    int failed = 0;
    for (int c = 0; c < COMPONENTS; c++) {
        const int begin = first_output[c], count = first_output[c + 1] - begin;
        failed |= fmus[c].get_real(instances[c], outputs + begin, (size_t)count,
                                   values + HELD + begin) != fmi2OK;
    }
    return failed;
}

static int initialize(fmi2Component *instances, const double *point, double *values) {
    int failed = 0;
    for (int c = 0; c < COMPONENTS; c++) {
        failed |= fmus[c].setup(instances[c], TOLERANCE > 0, TOLERANCE, times[0], fmi2True,
                                times[STEPS]) != fmi2OK;
    }
    for (int i = 0; i < LENGTH(reals); i++) {
        const struct real *set = &reals[i];
        failed |= fmus[set->component].set_real(instances[set->component], &set->reference, 1,
                                                &set->value) != fmi2OK;
    }
    for (int i = 0; i < LENGTH(integers); i++) {
        const struct integer *set = &integers[i];
        failed |= fmus[set->component].set_integer(instances[set->component], &set->reference, 1,
                                                   &set->value) != fmi2OK;
    }
    for (int i = 0; i < LENGTH(booleans); i++) {
        const struct integer *set = &booleans[i];
        failed |= fmus[set->component].set_boolean(instances[set->component], &set->reference, 1,
                                                   &set->value) != fmi2OK;
    }
    for (int i = 0; i < LENGTH(targets); i++) {
        const struct real *set = &targets[i];
        failed |= fmus[set->component].set_real(instances[set->component], &set->reference, 1,
                                                &point[i]) != fmi2OK;
    }
    for (int c = 0; c < COMPONENTS; c++) {
        failed |= fmus[c].enter(instances[c]) != fmi2OK;
    }
    memcpy(values, held, HELD * sizeof *held);
    for (int pass = 0; pass < COMPONENTS; pass++) { /* outputs reach all inputs */
        failed |= read_outputs(instances, values);
        failed |= set_inputs(instances, values);
    }
    for (int c = 0; c < COMPONENTS; c++) {
        failed |= fmus[c].leave(instances[c]) != fmi2OK;
    }
    return failed | read_outputs(instances, values);
}

static int run(fmi2Component *instances, const double *point, double (*result)[OUTPUTS]) {
    double values[HELD + OUTPUTS], *last = result[0], *largest = result[1];
    int failed = initialize(instances, point, values);
    memcpy(largest, values + HELD, OUTPUTS * sizeof *largest);
    for (int i = 0; i < STEPS && !failed; i++) {
        memcpy(values, held + i * HELD, HELD * sizeof *held);
        failed |= set_inputs(instances, values);
        for (int c = 0; c < COMPONENTS; c++) {
            failed |= fmus[c].do_step(instances[c], times[i], times[i + 1] - times[i], fmi2True) !=
                      fmi2OK;
        }
        failed |= read_outputs(instances, values);
        for (int k = 0; k < OUTPUTS; k++) {
            largest[k] = fmax(largest[k], values[HELD + k]);
        }
    }
    memcpy(last, values + HELD, OUTPUTS * sizeof *last);
    return failed;
}

static void *work_through(void *argument) {
    struct work *work = argument;
    const fmi2CallbackFunctions callbacks = {ignore, calloc, free, NULL, NULL};
    fmi2Component instances[COMPONENTS];
    for (int c = 0; c < COMPONENTS; c++) {
        instances[c] = fmus[c].instantiate("c_loop", fmi2CoSimulation, guids[c], "", &callbacks,
                                           fmi2False, fmi2False);
        if (instances[c] == NULL) {
            work->failed = 1;
            return NULL;
        }
    }
    for (int i = work->first; i < work->behind && !work->failed; i++) {
        work->failed = run(instances, points[i], results[i]);
        for (int c = 0; c < COMPONENTS; c++) {
            work->failed |= fmus[c].reset(instances[c]) != fmi2OK;
        }
    }
    for (int c = 0; c < COMPONENTS; c++) {
        fmus[c].free_instance(instances[c]);
    }
    return NULL;
}

static double now(clockid_t clock) {
    struct timespec time;
    clock_gettime(clock, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

/* Seconds of wall time; exits if a run fails. */
static double work_by(int threads, int runs) {
    struct work works[MAX_THREADS] = {0};
    const double begin = now(CLOCK_MONOTONIC);
    for (int i = 0; i < threads; i++) {
        works[i].first = i * runs / threads;
        works[i].behind = (i + 1) * runs / threads;
        if (pthread_create(&works[i].thread, NULL, work_through, &works[i]) != 0) {
            exit(2);
        }
    }
    int failed = 0;
    for (int i = 0; i < threads; i++) {
        pthread_join(works[i].thread, NULL);
        failed |= works[i].failed;
    }
    if (failed) {
        fprintf(stderr, "c_loop: a run failed\n");
        exit(1);
    }
    return now(CLOCK_MONOTONIC) - begin;
}

int main(int count, char **arguments) {
    const int runs = count == 4 ? atoi(arguments[1]) : 0;
    const int threads = count == 4 ? atoi(arguments[2]) : 0;
    if (runs < 1 || runs > RUNS || threads < 1 || threads > MAX_THREADS) {
        fprintf(stderr, "usage: c_loop RUNS THREADS RESULTS\n");
        return 2;
    }
    for (int c = 0; c < COMPONENTS; c++) {
        load(c);
    }
    const double wall = work_by(threads, runs);
    printf("%.6f %.6f\n", wall, now(CLOCK_PROCESS_CPUTIME_ID));
    FILE *file = fopen(arguments[3], "wb");
    return file == NULL || fwrite(results, sizeof *results, (size_t)runs, file) != (size_t)runs ||
           fclose(file) != 0;
}
