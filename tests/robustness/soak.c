/* Long runs in which the resident memory must not grow after a warm-up: instances that come and go,
 * and loading and unloading of the shared object. Steps ask for no memory: real_time.c. */
#define _GNU_SOURCE // mallinfo2, RTLD_NOLOAD

#include "fmu_version.h"
#include "value_references.h"

#include <dlfcn.h>
#include <malloc.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const long growth_limit = 64; /* KiB after the warm-up */

static struct fmu_functions fmu;
static unsigned long findings;

static void expect(bool is_right, const char *what) {
    if (!is_right && findings++ < 10) {
        printf("finding: %s\n", what);
    }
}

/* The FMU has nothing to say in these runs. */
static void receive(fmi2ComponentEnvironment environment, fmi2String instance_name,
                    fmi2Status status, fmi2String category, fmi2String message, ...) {
    expect(false, message);
}

/* ---- Memory --------------------------------------------------------------------------------- */

/* The kernel adds and drops pages of files, 64 KiB at a time: a leak shows in the other pages. */
struct memory {
    long own;  /* KiB, resident without pages of files */
    long used; /* bytes allocated */
};

static struct memory memory_now(void) {
    const long page = sysconf(_SC_PAGESIZE) / 1024;
    long size = 0;
    long resident = 0;
    long shared = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    // NOLINTNEXTLINE(cert-err34-c): the kernel writes numbers
    if (file == NULL || fscanf(file, "%ld %ld %ld", &size, &resident, &shared) != 3) {
        expect(false, "/proc/self/statm cannot be read");
    }
    if (file != NULL) {
        fclose(file);
    }
    return (struct memory){(resident - shared) * page, (long)mallinfo2().uordblks};
}

/* ---- Instances ------------------------------------------------------------------------------ */

/* The slide is pushed to and fro, against friction and both its stops, without end. */
static const fmi2ValueReference start_references[] = {
    RP_PLANT_g,      RP_PLANT_coulomb_friction1, RP_PLANT_coulomb_friction2, RP_PLANT_lower2,
    RP_PLANT_upper2, RP_PLANT_restitution2};
static const double starts[] = {0.0, 1000.0, 5.0, -5e-5, 5e-5, 0.5};
static const fmi2ValueReference items[] = {RP_PLANT_solver_method, RP_PLANT_stops2};
static const fmi2ValueReference driven = RP_PLANT_f2;
static const fmi2ValueReference watched = RP_PLANT_q2;
static const double effort = 20.0;

#define COUNT(array) (sizeof(array) / sizeof(array)[0])

static fmi2Component initialized(fmi2Type kind, fmi2Integer method) {
    const fmi2CallbackFunctions callbacks = {.logger = receive};
    const fmi2Integer rigid = 2;
    const fmi2Integer numbers[] = {method, rigid};
    const fmi2Component c =
        fmu.Instantiate("soak", kind, RP_PLANT_GUID, NULL, &callbacks, fmi2False, fmi2False);
    expect(c != NULL, "no instance");
    expect(fmu.SetReal(c, start_references, COUNT(starts), starts) == fmi2OK, "start values");
    expect(fmu.SetInteger(c, items, COUNT(items), numbers) == fmi2OK, "method");
    expect(fmu.SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK, "experiment");
    expect(fmu.EnterInitializationMode(c) == fmi2OK, "initialization");
    expect(fmu.ExitInitializationMode(c) == fmi2OK, "end of initialization");
    return c;
}

/* One step of 1 ms; the effort changes its sign at every third. */
static double step(fmi2Component c, unsigned long i) {
    const double value = i / 3 % 2 == 0 ? effort : -effort;
    double output = NAN;
    expect(fmu.SetReal(c, &driven, 1, &value) == fmi2OK, "input");
    expect(fmu.DoStep(c, (double)i * 1e-3, 1e-3, fmi2True) == fmi2OK, "step");
    expect(fmu.GetReal(c, &watched, 1, &output) == fmi2OK && isfinite(output), "output");
    return output;
}

/* A step, undone and done again from the same bytes. */
static double step_again(fmi2Component c, unsigned long i, bool as_bytes) {
    fmi2FMUstate state = NULL;
    fmi2FMUstate read = NULL;
    fmi2Byte bytes[4096];
    size_t size = 0;
    expect(fmu.GetFMUstate(c, &state) == fmi2OK, "saving");
    if (as_bytes) {
        expect(fmu.SerializedFMUstateSize(c, state, &size) == fmi2OK && size <= sizeof bytes,
               "size of a state");
        expect(fmu.SerializeFMUstate(c, state, bytes, size) == fmi2OK, "serialization");
        expect(fmu.DeSerializeFMUstate(c, bytes, size, &read) == fmi2OK, "deserialization");
    }
    const double first = step(c, i);
    expect(fmu.SetFMUstate(c, as_bytes ? read : state) == fmi2OK, "restoring");
    const double second = step(c, i);
    expect(memcmp(&first, &second, sizeof first) == 0, "another value after a rollback");
    expect(fmu.FreeFMUstate(c, &state) == fmi2OK && fmu.FreeFMUstate(c, &read) == fmi2OK,
           "freeing a state");
    return second;
}

/* ---- Cycles --------------------------------------------------------------------------------- */

/* Instantiate, run, free; snapshots are freed by every other instance only. */
static void live(unsigned long cycle) {
    static double outputs[3];
    const fmi2Integer method = (fmi2Integer)(cycle % 3) + 1;
    const bool is_model_exchange = cycle % 7 == 0;
    const fmi2Component c =
        initialized(is_model_exchange ? fmi2ModelExchange : fmi2CoSimulation, method);
    fmi2FMUstate kept = NULL;
    expect(fmu.GetFMUstate(c, &kept) == fmi2OK, "saving");
    if (!is_model_exchange) {
        double last = 0.0;
        for (unsigned long i = 0; i < 5; i++) {
            last = i == 3 ? step_again(c, i, cycle % 2 == 0) : step(c, i);
        }
        expect(cycle < 6 || memcmp(&outputs[method - 1], &last, sizeof last) == 0,
               "another result than in the first cycle");
        outputs[method - 1] = last;
    }
    if (cycle % 2 == 0) {
        expect(fmu.FreeFMUstate(c, &kept) == fmi2OK, "freeing a state");
    }
    fmu.FreeInstance(c);
}

static const char *paths[3]; /* this build's FMU first */

/* As importers do: load, instantiate, a few steps, free, unload. Two other FMUs are loaded
 * meanwhile and unloaded in the same order. */
static void reload(unsigned long cycle) {
    void *others[2];
    void *library = fmu_version_open(&fmu);
    if (library == NULL) {
        expect(false, "the FMU cannot be loaded");
        return;
    }
    for (int i = 0; i < 2; i++) {
        others[i] = dlopen(paths[i + 1], RTLD_NOW | RTLD_LOCAL);
        expect(others[i] != NULL, "another FMU cannot be loaded");
    }
    live(cycle);
    expect(dlclose(library) == 0, "the FMU cannot be unloaded");
    expect(dlopen(paths[0], RTLD_NOW | RTLD_NOLOAD) == NULL, "the FMU is still loaded");
    for (int i = 0; i < 2; i++) {
        if (others[i] != NULL) {
            dlclose(others[i]);
        }
    }
}

/* ---- Campaigns ------------------------------------------------------------------------------ */

static const struct campaign {
    const char *name;
    void (*cycle)(unsigned long number);
    bool loads; /* by itself */
} campaigns[] = {
    {"life", live, false},
    {"reload", reload, true},
};

/* The first tenth warms up. */
static void run(const struct campaign *campaign, unsigned long count) {
    struct memory before = {0};
    for (unsigned long i = 0; i < count; i++) {
        if (i == count / 10) {
            before = memory_now();
        }
        campaign->cycle(i);
    }
    const struct memory after = memory_now();
    const long growth = after.own - before.own;
    expect(growth <= growth_limit, "the resident memory grows");
    expect(after.used - before.used <= growth_limit * 1024, "the allocated memory grows");
    printf("figures: soak %s, FMI %u.0; cycles %lu; findings %lu; memory growth %ld KiB; growth of "
           "allocated memory %ld bytes\n",
           campaign->name, fmu_version, count, findings, growth, after.used - before.used);
}

int main(int argc, char **argv) {
    const unsigned long count = argc == 6 ? strtoul(argv[2], NULL, 10) : 0;
    for (size_t i = 0; count > 0 && i < sizeof campaigns / sizeof campaigns[0]; i++) {
        if (strcmp(argv[1], campaigns[i].name) == 0) {
            memcpy(paths, &argv[3], sizeof paths);
            if (!campaigns[i].loads && fmu_version_open(&fmu) == NULL) {
                return 2;
            }
            run(&campaigns[i], count);
            return findings == 0 ? 0 : 1;
        }
    }
    fprintf(stderr, "usage: %s life|reload CYCLES FMU.so ANOTHER.so ANOTHER.so\n", argv[0]);
    return 2;
}
