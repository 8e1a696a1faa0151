/* How much work a step of the plant is, or of six.toml: random steps of 1 ms with friction that
 * holds and stops, counted in blocks of code by a library compiled with
 * -fsanitize-coverage=trace-pc. value_references.h decides which model it is.
 *
 *     real_time count LIBRARY METHOD RESTITUTION STEPS SEED WORST MEDIAN
 *         prints a line for each number of events in a step: that number, how many such steps, the
 *         median and the largest count; writes to two files the instance before the step with the
 *         largest count and before one with the median count
 *     real_time replay LIBRARY METHOD FILE
 *         makes the step of a file: for a program that counts instructions
 *     real_time confined LIBRARY METHOD STEPS SEED
 *         makes the steps where the kernel kills a process that calls it */
#define _GNU_SOURCE // syscall

#include "fmu_library.h"
#include "value_references.h"

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#define COUNT(array) (sizeof(array) / sizeof(array)[0])

static const double step_size = 1e-3; /* s */
static struct fmu_functions fmu;
static uint64_t blocks;

/* Called by the library at the beginning of each block. */
__attribute__((visibility("default"))) void __sanitizer_cov_trace_pc(void);
void __sanitizer_cov_trace_pc(void) {
    blocks++;
}

static void require(bool is_true, const char *what) {
    if (!is_true) {
        fprintf(stderr, "real_time: %s\n", what);
        exit(1);
    }
}

static void receive(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                    fmi2String category, fmi2String message, ...) {
    fprintf(stderr, "%s\n", message);
}

/* A serialized instance and the step that follows. */
struct work {
    double time;
    double efforts[2]; /* N.m, N */
    size_t size;
    fmi2Byte state[8192];
};

/* ---- Models --------------------------------------------------------------------------------- */

#ifdef SIX_GUID
#define MODEL(name) SIX_##name
static const double mean_effort = 0.0; /* N */
static const fmi2ValueReference efforts[] = {SIX_u1, SIX_u2};
static const fmi2ValueReference restitutions[] = {SIX_e};

static bool set_parameters(fmi2Component c) {
    return c != NULL;
}
#else
#define MODEL(name) RP_PLANT_##name
static const double mean_effort = 12.0; /* N.m, against gravity */
static const fmi2ValueReference efforts[] = {RP_PLANT_tau1, RP_PLANT_f2};
static const fmi2ValueReference restitutions[] = {RP_PLANT_restitution1, RP_PLANT_restitution2};

static bool set_parameters(fmi2Component c) {
    static const fmi2ValueReference references[] = {RP_PLANT_coulomb_friction1,
                                                    RP_PLANT_coulomb_friction2,
                                                    RP_PLANT_breakaway_friction1,
                                                    RP_PLANT_breakaway_friction2,
                                                    RP_PLANT_stribeck_velocity1,
                                                    RP_PLANT_stribeck_velocity2,
                                                    RP_PLANT_damping1,
                                                    RP_PLANT_damping2,
                                                    RP_PLANT_lower1,
                                                    RP_PLANT_upper1,
                                                    RP_PLANT_lower2,
                                                    RP_PLANT_upper2};
    static const double values[] = {4.0, 3.0, 6.0, 5.0, 0.05, 0.05, 0.5, 2.0, -1.0, 1.0, -0.1, 0.2};
    static const fmi2ValueReference stops[] = {RP_PLANT_stops1, RP_PLANT_stops2};
    static const fmi2Integer rigid[] = {2, 2};
    return fmu.SetReal(c, references, COUNT(references), values) == fmi2OK &&
           fmu.SetInteger(c, stops, COUNT(stops), rigid) == fmi2OK;
}
#endif

static double restitution = 0.5;

static fmi2Component initialized(fmi2Integer method) {
    static const fmi2CallbackFunctions callbacks = {.logger = receive};
    static const fmi2ValueReference solver_method = MODEL(solver_method);
    const double both[] = {restitution, restitution};
    const fmi2Component c = fmu.Instantiate("real_time", fmi2CoSimulation, MODEL(GUID), NULL,
                                            &callbacks, fmi2False, fmi2False);
    require(c != NULL, "no instance");
    require(set_parameters(c) &&
                fmu.SetReal(c, restitutions, COUNT(restitutions), both) == fmi2OK &&
                fmu.SetInteger(c, &solver_method, 1, &method) == fmi2OK &&
                fmu.SetupExperiment(c, fmi2True, 1e-8, 0.0, fmi2False, 0.0) == fmi2OK &&
                fmu.EnterInitializationMode(c) == fmi2OK && fmu.ExitInitializationMode(c) == fmi2OK,
            "initialization failed");
    return c;
}

static void set_and_step(fmi2Component c, const struct work *work) {
    require(fmu.SetReal(c, efforts, COUNT(efforts), work->efforts) == fmi2OK, "no efforts");
    require(fmu.DoStep(c, work->time, step_size, fmi2True) == fmi2OK, "the step failed");
}

/* ---- Random steps --------------------------------------------------------------------------- */

static uint64_t seed;

/* In [-1, 1): splitmix64. */
static double chance(void) {
    uint64_t x = seed += UINT64_C(0x9e3779b97f4a7c15);
    x = (x ^ x >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    x = (x ^ x >> 27) * UINT64_C(0x94d049bb133111eb);
    return (double)(int64_t)(x ^ x >> 31) * 0x1p-63;
}

/* Efforts that push a joint for a while, with a ripple, and now and then hold it. */
static void draw_efforts(long i, double drawn[2]) {
    static double push[2];
    for (int k = 0; k < 2; k++) {
        if (i == 0 || chance() > 0.99) {
            push[k] = chance() > 0.6 ? 0.0 : 25.0 * chance();
        }
    }
    drawn[0] = mean_effort + push[0] + 0.5 * chance();
    drawn[1] = push[1] + 0.5 * chance();
}

/* ---- Counting ------------------------------------------------------------------------------- */

enum { MOST_EVENTS = 64, MOST_BLOCKS = 1 << 18 };
enum { SHARE = 8 }; /* blocks in a bin */
static uint32_t histogram[MOST_EVENTS][MOST_BLOCKS / SHARE];
static uint64_t largest[MOST_EVENTS];

static uint64_t median_of(const uint32_t bins[MOST_BLOCKS / SHARE], uint64_t steps) {
    uint64_t count = 0;
    uint64_t at = 0;
    while (count + bins[at] <= steps / 2) {
        count += bins[at++];
    }
    return at * SHARE;
}

static uint64_t steps_with(int events) {
    uint64_t steps = 0;
    for (size_t k = 0; k < MOST_BLOCKS / SHARE; k++) {
        steps += histogram[events][k];
    }
    return steps;
}

static void write_work(const char *path, const struct work *work) {
    FILE *file = fopen(path, "wb");
    require(file != NULL && fwrite(work, sizeof *work, 1, file) == 1 && fclose(file) == 0,
            "a file cannot be written");
}

static void save(fmi2Component c, fmi2FMUstate *state, struct work *work) {
    require(fmu.GetFMUstate(c, state) == fmi2OK &&
                fmu.SerializedFMUstateSize(c, *state, &work->size) == fmi2OK &&
                work->size <= sizeof work->state &&
                fmu.SerializeFMUstate(c, *state, work->state, work->size) == fmi2OK,
            "the state cannot be saved");
}

static int events_of(fmi2Component c) {
    static const fmi2ValueReference event_count = MODEL(event_count);
    fmi2Integer events = 0;
    require(fmu.GetInteger(c, &event_count, 1, &events) == fmi2OK, "no count of events");
    return events;
}

/* The steps to be written: saving each one would take ten times as long as making it. */
enum { WORST, MEDIAN, CHOSEN };

/* Makes random steps. Counts them and writes the indices of the chosen ones or, if there are paths,
 * writes these steps to files. */
static void make_steps(fmi2Integer method, long steps, long chosen[CHOSEN],
                       char *const paths[CHOSEN]) {
    static struct work work;
    const fmi2Component c = initialized(method);
    fmi2FMUstate state = NULL;
    uint64_t most = 0;
    uint64_t middle = 0;
    int before = 0;
    for (long i = 0; i < steps; i++) {
        work.time = (double)i * step_size;
        draw_efforts(i, work.efforts);
        for (int k = 0; paths != NULL && k < CHOSEN; k++) {
            if (i == chosen[k]) {
                save(c, &state, &work);
                write_work(paths[k], &work);
            }
        }
        blocks = 0;
        set_and_step(c, &work);
        if (paths != NULL) {
            continue;
        }
        const uint64_t count = blocks;
        const int events = events_of(c) - before;
        before += events;
        require(events < MOST_EVENTS && count < (uint64_t)MOST_BLOCKS * 8,
                "a step of too much work");
        const uint64_t bin = count / SHARE;
        histogram[events][bin < MOST_BLOCKS / SHARE ? bin : MOST_BLOCKS / SHARE - 1]++;
        largest[events] = count > largest[events] ? count : largest[events];
        if (count > most) {
            most = count;
            chosen[WORST] = i;
        }
        if (i < 1000000 && i % 1000 == 999) {
            middle = median_of(histogram[0], steps_with(0));
        }
        if (events == 0 && bin == middle / SHARE) {
            chosen[MEDIAN] = i;
        }
    }
    fmu.FreeInstance(c);
}

static void count_steps(fmi2Integer method, long steps, char *const paths[CHOSEN]) {
    long chosen[CHOSEN] = {0};
    const uint64_t first_seed = seed;
    make_steps(method, steps, chosen, NULL);
    seed = first_seed;
    make_steps(method, 1 + (chosen[WORST] > chosen[MEDIAN] ? chosen[WORST] : chosen[MEDIAN]),
               chosen, paths);
    for (int events = 0; events < MOST_EVENTS; events++) {
        const uint64_t found = steps_with(events);
        if (found > 0) {
            printf("%d %llu %llu %llu\n", events, (unsigned long long)found,
                   (unsigned long long)median_of(histogram[events], found),
                   (unsigned long long)largest[events]);
        }
    }
}

static void replay(fmi2Integer method, const char *path) {
    static struct work work;
    FILE *file = fopen(path, "rb");
    require(file != NULL, "a file cannot be opened");
    const size_t read = fread(&work, sizeof work, 1, file);
    fclose(file);
    require(read == 1, "a file is too short");
    const fmi2Component c = initialized(method);
    fmi2FMUstate state = NULL;
    require(fmu.DeSerializeFMUstate(c, work.state, work.size, &state) == fmi2OK &&
                fmu.SetFMUstate(c, state) == fmi2OK,
            "the state cannot be restored");
    set_and_step(c, &work);
    fmu.FreeInstance(c);
}

/* ---- Confined ------------------------------------------------------------------------------- */

/* Only read, write and exit are left. */
static void step_confined(fmi2Integer method, long steps) {
    static struct work work;
    static const char done[] = "done\n";
    const fmi2Component c = initialized(method);
    require(prctl(PR_SET_SECCOMP, SECCOMP_MODE_STRICT) == 0, "no confinement");
    for (long i = 0; i < steps; i++) {
        work.time = (double)i * step_size;
        draw_efforts(i, work.efforts);
        set_and_step(c, &work);
    }
    syscall(SYS_exit, write(STDOUT_FILENO, done, sizeof done - 1) != sizeof done - 1);
}

int main(int count, char **arguments) {
    const char *what = count > 3 ? arguments[1] : "";
    require((strcmp(what, "count") == 0 && count == 9) ||
                (strcmp(what, "replay") == 0 && count == 5) ||
                (strcmp(what, "confined") == 0 && count == 6),
            "see real_time.c");
    require(fmu_library_open(arguments[2], &fmu) != NULL, "the library cannot be loaded");
    const fmi2Integer method = (fmi2Integer)strtol(arguments[3], NULL, 10);
    if (what[0] == 'r') {
        replay(method, arguments[4]);
        return 0;
    }
    seed = strtoull(arguments[count == 9 ? 6 : 5], NULL, 10);
    if (what[0] == 'c' && what[2] == 'u') {
        restitution = strtod(arguments[4], NULL);
        count_steps(method, strtol(arguments[5], NULL, 10), arguments + 7);
    } else {
        step_confined(method, strtol(arguments[4], NULL, 10));
    }
    return 0;
}
