/* Many threads with many instances each, which step, save, restore, serialize and move to new
 * instances in between. Every value after every step must have the same bits as in one
 * instance alone in one thread. Run with ThreadSanitizer too: preset tsan. */
#include "fmu_harness.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

enum { VARIANTS = 30, METHODS = 3, BYTES = 2048, MOST_THREADS = 256 };

static struct fmu_run expected[VARIANTS]; /* of one instance alone */

struct work {
    unsigned number;
    unsigned instance_count;
    unsigned long calls;
    unsigned findings; /* a status that is not fmi2OK, or other bits */
    struct fmu_log log;
};

/* What harness and threads call; Unity knows nothing of threads. */
void setUp(void) {}

void tearDown(void) {}

/* ---- One instance --------------------------------------------------------------------------- */

static fmi2Status worse(fmi2Status a, fmi2Status b) {
    return a > b ? a : b;
}

static fmi2Component instantiate(struct fmu_log *log) {
    const fmi2CallbackFunctions callbacks = fmu_callbacks(log);
    return fmu.Instantiate("thread", fmi2CoSimulation, RP_MANIPULATOR_GUID, NULL, &callbacks,
                           fmi2False, fmi2False);
}

static fmi2Status start(fmi2Component c, unsigned variant) {
    const fmi2ValueReference reference = RP_MANIPULATOR_solver_method;
    const fmi2Integer method = (fmi2Integer)(variant % METHODS) + 1;
    const fmi2Status status = fmu.SetInteger(c, &reference, 1, &method);
    return worse(status, fmu_run_start(fmi2CoSimulation, c, variant));
}

/* A step, undone and done again. */
static fmi2Status step_twice(fmi2Component c, unsigned step, struct fmu_run *run) {
    fmi2FMUstate state = NULL;
    fmi2Status status = fmu.GetFMUstate(c, &state);
    status = worse(status, fmu_run_step(fmi2CoSimulation, c, step, run));
    status = worse(status, fmu.SetFMUstate(c, state));
    status = worse(status, fmu_run_step(fmi2CoSimulation, c, step, run));
    return step % 2 == 0 ? worse(status, fmu.FreeFMUstate(c, &state)) : status;
}

/* Another instance takes over from the serialized state of *c. */
static fmi2Status move(fmi2Component *c, struct fmu_log *log) {
    fmi2FMUstate state = NULL;
    fmi2Byte bytes[BYTES];
    size_t size = 0;
    fmi2Status status = fmu.GetFMUstate(*c, &state);
    status = worse(status, fmu.SerializedFMUstateSize(*c, state, &size));
    if (status != fmi2OK || size > sizeof bytes) {
        return fmi2Fatal;
    }
    status = fmu.SerializeFMUstate(*c, state, bytes, size);
    fmu.FreeInstance(*c);
    *c = instantiate(log);
    status = worse(status, fmu.DeSerializeFMUstate(*c, bytes, size, &state));
    return worse(status, fmu.SetFMUstate(*c, state));
}

/* ---- One thread ----------------------------------------------------------------------------- */

static unsigned variant_of(const struct work *work, unsigned instance) {
    return (work->number + instance) % VARIANTS;
}

static void note(struct work *work, bool is_right) {
    work->findings += !is_right;
}

static void step_instance(struct work *work, fmi2Component *c, unsigned instance, unsigned step,
                          struct fmu_run *run) {
    const unsigned what = (instance + step) % 4;
    fmi2Status status = what == 1 ? move(c, &work->log) : fmi2OK;
    status = worse(status, what == 2 ? step_twice(*c, step, run)
                                     : fmu_run_step(fmi2CoSimulation, *c, step, run));
    const struct fmu_run *alone = &expected[variant_of(work, instance)];
    note(work, status == fmi2OK &&
                   memcmp(&run->after[step], &alone->after[step], sizeof run->after[step]) == 0);
    work->calls += 2 + fmu_variable_count;
}

/* All instances live at once and take turns. */
static void *run_instances(void *work_pointer) {
    struct work *work = work_pointer;
    fmi2Component *instances = calloc(work->instance_count, sizeof *instances);
    struct fmu_run *run = calloc(1, sizeof *run);
    if (instances == NULL || run == NULL) {
        note(work, false);
        free(instances);
        free(run);
        return NULL;
    }
    for (unsigned i = 0; i < work->instance_count; i++) {
        instances[i] = instantiate(&work->log);
        note(work, start(instances[i], variant_of(work, i)) == fmi2OK);
    }
    for (unsigned step = 0; step < FMU_RUN_STEPS; step++) {
        for (unsigned i = 0; i < work->instance_count; i++) {
            step_instance(work, &instances[i], i, step, run);
        }
    }
    for (unsigned i = 0; i < work->instance_count; i++) {
        fmu.FreeInstance(instances[i]);
    }
    note(work, fmu_log_total(&work->log) == 0);
    free(instances);
    free(run);
    return NULL;
}

/* ---- All threads ---------------------------------------------------------------------------- */

static bool run_alone(void) {
    static struct fmu_log log;
    fmi2Status status = fmi2OK;
    for (unsigned variant = 0; variant < VARIANTS; variant++) {
        const fmi2Component c = instantiate(&log);
        status = worse(status, start(c, variant));
        for (unsigned step = 0; step < FMU_RUN_STEPS; step++) {
            status = worse(status, fmu_run_step(fmi2CoSimulation, c, step, &expected[variant]));
        }
        fmu.FreeInstance(c);
    }
    return status == fmi2OK && memcmp(&expected[0], &expected[1], sizeof expected[0]) != 0;
}

static unsigned run_threads(unsigned thread_count, unsigned instance_count) {
    static struct work work[MOST_THREADS];
    pthread_t threads[MOST_THREADS];
    unsigned findings = 0;
    unsigned started = 0;
    unsigned long calls = 0;
    for (unsigned i = 0; i < thread_count; i++) {
        work[i].number = i;
        work[i].instance_count = instance_count;
        if (pthread_create(&threads[i], NULL, run_instances, &work[i]) != 0) {
            break;
        }
        started++;
    }
    for (unsigned i = 0; i < started; i++) {
        pthread_join(threads[i], NULL);
        findings += work[i].findings;
        calls += work[i].calls;
        if (work[i].findings > 0) {
            printf("thread %u: %u findings; messages: %s\n", i, work[i].findings,
                   work[i].log.texts);
        }
    }
    findings += thread_count - started;
    printf("figures: threads, FMI %u.0; threads %u; calls %lu; instances %u; findings %u\n",
           fmu_version, thread_count, calls, thread_count * instance_count, findings);
    return findings;
}

int main(int argc, char **argv) {
    const long threads = argc == 3 ? strtol(argv[1], NULL, 10) : 0;
    const long instances = argc == 3 ? strtol(argv[2], NULL, 10) : 0;
    if (threads < 1 || threads > MOST_THREADS || instances < 1) {
        fprintf(stderr, "usage: %s THREADS INSTANCES\n", argv[0]);
        return 2;
    }
    fmu_load();
    if (!run_alone()) {
        return 2;
    }
    return run_threads((unsigned)threads, (unsigned)instances) == 0 ? 0 : 1;
}
