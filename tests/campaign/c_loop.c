/* The runs of rate.py by a plain loop in C: what a campaign's rate is compared with.
 *
 * c_loop LIBRARY GUID RUNS THREADS: each thread has one instance and
 * resets it between runs. Prints seconds of wall time and of processor time, and a sum of results.
 */
#define _POSIX_C_SOURCE 200809L

#include <dlfcn.h>
#include <math.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2Functions.h"

#define STEPS       2000
#define STEP        1e-3 /* s */
#define TOLERANCE   1e-8
#define MAX_THREADS 64

enum { M2 = 2, Q1 = 10, Q2 = 11, DQ1 = 12, DQ2 = 13, TAU1 = 20, F2 = 21 };

static fmi2InstantiateTYPE *instantiate;
static fmi2FreeInstanceTYPE *free_instance;
static fmi2ResetTYPE *reset;
static fmi2SetupExperimentTYPE *setup;
static fmi2EnterInitializationModeTYPE *enter;
static fmi2ExitInitializationModeTYPE *leave;
static fmi2SetRealTYPE *set_real;
static fmi2GetRealTYPE *get_real;
static fmi2DoStepTYPE *do_step;

static double inputs[STEPS][2];
static const char *guid;

struct work {
    pthread_t thread;
    unsigned runs, first;
    double sum;
    int failed;
};

static void ignore(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                   fmi2String category, fmi2String message, ...) {
    (void)environment, (void)name, (void)status, (void)category, (void)message;
}

static void *find(void *library, const char *name) {
    void *function = dlsym(library, name);
    if (function == NULL) {
        fprintf(stderr, "c_loop: no %s\n", name);
        exit(2);
    }
    return function;
}

/* One run; the largest q2, which a campaign keeps, too. */
static int run(fmi2Component instance, double m2, double q1, double *largest) {
    static const fmi2ValueReference in[] = {TAU1, F2}, out[] = {Q1, Q2, DQ1, DQ2};
    const fmi2ValueReference mass = M2, angle = Q1;
    double state[4];

    int failed = setup(instance, fmi2True, TOLERANCE, 0.0, fmi2True, STEPS * STEP) != fmi2OK;
    failed |= set_real(instance, &mass, 1, &m2) != fmi2OK;
    failed |= set_real(instance, &angle, 1, &q1) != fmi2OK;
    failed |= enter(instance) != fmi2OK;
    failed |= set_real(instance, in, 2, inputs[0]) != fmi2OK;
    failed |= leave(instance) != fmi2OK;
    *largest = -INFINITY;
    for (int i = 0; i < STEPS && !failed; i++) {
        failed |= set_real(instance, in, 2, inputs[i]) != fmi2OK;
        failed |= do_step(instance, i * STEP, (i + 1) * STEP - i * STEP, fmi2True) != fmi2OK;
        failed |= get_real(instance, out, 4, state) != fmi2OK;
        if (state[1] > *largest) {
            *largest = state[1];
        }
    }
    return failed;
}

static void *work_through(void *argument) {
    struct work *work = argument;
    const fmi2CallbackFunctions callbacks = {ignore, calloc, free, NULL, NULL};
    fmi2Component instance =
        instantiate("c_loop", fmi2CoSimulation, guid, "", &callbacks, fmi2False, fmi2False);
    if (instance == NULL) {
        work->failed = 1;
        return NULL;
    }
    for (unsigned i = 0; i < work->runs && !work->failed; i++) {
        /* all over the box of rate.py, in the order of the golden ratio */
        const double u = fmod(0.61803398874989485 * (work->first + i), 1.0);
        double largest;
        work->failed = run(instance, 0.8 + 0.4 * u, -1.6 + 0.2 * u, &largest) != 0;
        work->sum += largest;
        work->failed |= reset(instance) != fmi2OK;
    }
    free_instance(instance);
    return NULL;
}

static double now(clockid_t clock) {
    struct timespec time;
    clock_gettime(clock, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

int main(int count, char **arguments) {
    if (count != 5) {
        fprintf(stderr, "usage: c_loop LIBRARY GUID RUNS THREADS\n");
        return 2;
    }
    void *library = dlopen(arguments[1], RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) {
        fprintf(stderr, "c_loop: %s\n", dlerror());
        return 2;
    }
    guid = arguments[2];
    *(void **)&instantiate = find(library, "fmi2Instantiate");
    *(void **)&free_instance = find(library, "fmi2FreeInstance");
    *(void **)&reset = find(library, "fmi2Reset");
    *(void **)&setup = find(library, "fmi2SetupExperiment");
    *(void **)&enter = find(library, "fmi2EnterInitializationMode");
    *(void **)&leave = find(library, "fmi2ExitInitializationMode");
    *(void **)&set_real = find(library, "fmi2SetReal");
    *(void **)&get_real = find(library, "fmi2GetReal");
    *(void **)&do_step = find(library, "fmi2DoStep");
    for (int i = 0; i < STEPS; i++) {
        const double t = i * STEP, turn = 2 * 3.14159265358979323846;
        inputs[i][0] = -0.78 + 2.28 * sin(turn * 0.42 * t + 0.03);
        inputs[i][1] =
            -10.15 + 0.9 * sin(turn * 0.84 * t + 2.9) + 2.09 * sin(turn * 0.57 * t - 1.77);
    }

    struct work works[MAX_THREADS] = {0};
    const unsigned runs = (unsigned)strtoul(arguments[3], NULL, 10);
    const unsigned threads = (unsigned)strtoul(arguments[4], NULL, 10);
    if (threads < 1 || threads > MAX_THREADS) {
        return 2;
    }
    const double begin = now(CLOCK_MONOTONIC);
    for (unsigned i = 0; i < threads; i++) {
        works[i].first = i * (runs / threads);
        works[i].runs = runs / threads;
        if (pthread_create(&works[i].thread, NULL, work_through, &works[i]) != 0) {
            return 2;
        }
    }
    double sum = 0.0;
    int failed = 0;
    for (unsigned i = 0; i < threads; i++) {
        pthread_join(works[i].thread, NULL);
        sum += works[i].sum;
        failed |= works[i].failed;
    }
    const double wall = now(CLOCK_MONOTONIC) - begin;
    printf("%.6f %.6f %.17g\n", wall, now(CLOCK_PROCESS_CPUTIME_ID), sum);
    dlclose(library);
    return failed;
}
