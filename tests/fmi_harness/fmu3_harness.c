#include "fmu3_harness.h"

#include "fmu_library.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

struct fmu3_functions fmu3;
struct fmu3_importer importer;

void fmu3_load(void) {
    // never closed: leak reports need the names of its functions
    if (fmu3_library_open(FMU_LIBRARY, &fmu3) == NULL) {
        exit(2);
    }
}

/* ---- An importer ---------------------------------------------------------------------------- */

/* Called from within the FMU: it only takes notes, an assertion would jump out of the call. */
static void receive(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                    fmi3String message) {
    struct fmu3_importer *to = environment;
    to->malformed += category == NULL || !fmu_is_harmless(message, "#");
    to->count[status]++;
    snprintf(to->category, sizeof to->category, "%s", category != NULL ? category : "");
    const size_t used = strlen(to->texts);
    snprintf(to->texts + used, sizeof to->texts - used, "%s\n", message != NULL ? message : "");
}

static void update(fmi3InstanceEnvironment environment, fmi3Float64 time, fmi3Boolean set,
                   fmi3Boolean get, fmi3Boolean finished, fmi3Boolean can_return_early,
                   fmi3Boolean *return_early, fmi3Float64 *early_time) {
    struct fmu3_importer *to = environment;
    const struct fmu3_update said = {time,         set,       get, finished, can_return_early,
                                     return_early, early_time};
    to->updates++;
    if (to->update != NULL) {
        to->update(to, &said);
    }
}

void fmu3_clear_messages(struct fmu3_importer *of) {
    memset(of->count, 0, sizeof of->count);
    of->texts[0] = '\0';
    of->category[0] = '\0';
}

unsigned fmu3_message_count(const struct fmu3_importer *of) {
    unsigned total = 0;
    for (size_t i = 0; i < FMU3_COUNT(of->count); i++) {
        total += of->count[i];
    }
    return total;
}

void fmu3_assert_logged(const struct fmu3_importer *of, const char *text) {
    char failure[2048];
    snprintf(failure, sizeof failure, "expected '%s' in the messages: %.1500s", text, of->texts);
    TEST_ASSERT_TRUE_MESSAGE(strstr(of->texts, text) != NULL, failure);
}

/* ---- Instances ------------------------------------------------------------------------------ */

static fmi3Instance open_instances[64];

static fmi3Instance keep(struct fmu3_importer *for_importer, fmi3Instance instance) {
    TEST_ASSERT_NOT_NULL_MESSAGE(instance, for_importer->texts);
    for_importer->instance = instance;
    for (size_t i = 0; i < FMU3_COUNT(open_instances); i++) {
        if (open_instances[i] == NULL) {
            open_instances[i] = instance;
            return instance;
        }
    }
    TEST_FAIL_MESSAGE("more instances than the harness has room for");
    return NULL;
}

fmi3Instance fmu3_try_co_simulation(struct fmu3_importer *for_importer,
                                    const struct fmu3_options *options) {
    return fmu3.InstantiateCoSimulation(
        "manipulator", RP_MANIPULATOR_TOKEN_FMI3, "", false, options->logging_on,
        options->event_mode, options->early_return, options->required, options->required_count,
        for_importer, receive, options->intermediate_updates ? update : NULL);
}

fmi3Instance fmu3_co_simulation(struct fmu3_importer *for_importer,
                                const struct fmu3_options *options) {
    static const struct fmu3_options none = {0};
    return keep(for_importer,
                fmu3_try_co_simulation(for_importer, options != NULL ? options : &none));
}

fmi3Instance fmu3_model_exchange(struct fmu3_importer *for_importer) {
    return keep(for_importer,
                fmu3.InstantiateModelExchange("manipulator", RP_MANIPULATOR_TOKEN_FMI3, NULL, false,
                                              false, for_importer, receive));
}

void fmu3_free(fmi3Instance instance) {
    for (size_t i = 0; i < FMU3_COUNT(open_instances); i++) {
        if (open_instances[i] == instance) {
            open_instances[i] = NULL;
        }
    }
    fmu3.FreeInstance(instance);
}

void fmu3_tear_down(void) {
    for (size_t i = 0; i < FMU3_COUNT(open_instances); i++) {
        fmu3.FreeInstance(open_instances[i]);
        open_instances[i] = NULL;
    }
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, importer.malformed, importer.texts);
}

void fmu3_initialize(fmi3Instance instance, double start) {
    ASSERT_OK(fmu3.EnterInitializationMode(instance, false, 0.0, start, false, 0.0));
    ASSERT_OK(fmu3.ExitInitializationMode(instance));
}

/* ---- Values --------------------------------------------------------------------------------- */

fmi3Status fmu3_try_set(fmi3Instance instance, fmi3ValueReference reference, double value) {
    return fmu3.SetFloat64(instance, &reference, 1, &value, 1);
}

void fmu3_set(fmi3Instance instance, fmi3ValueReference reference, double value) {
    ASSERT_OK(fmu3_try_set(instance, reference, value));
}

double fmu3_get(fmi3Instance instance, fmi3ValueReference reference) {
    double value = 0.0;
    ASSERT_OK(fmu3.GetFloat64(instance, &reference, 1, &value, 1));
    return value;
}

void fmu3_set_int32(fmi3Instance instance, fmi3ValueReference reference, fmi3Int32 value) {
    ASSERT_OK(fmu3.SetInt32(instance, &reference, 1, &value, 1));
}

void fmu3_set_method(fmi3Instance instance, int method) {
    const fmi3ValueReference reference = RP_MANIPULATOR_solver_method;
    const fmi3Int64 item = method;
    ASSERT_OK(fmu3.SetInt64(instance, &reference, 1, &item, 1));
}

const fmi3ValueReference fmu3_states[FMU3_STATES] = {RP_MANIPULATOR_q1, RP_MANIPULATOR_q2,
                                                     RP_MANIPULATOR_dq1, RP_MANIPULATOR_dq2};

void fmu3_get_states(fmi3Instance instance, double x[FMU3_STATES]) {
    ASSERT_OK(fmu3.GetFloat64(instance, fmu3_states, FMU3_STATES, x, FMU3_STATES));
}

/* ---- Steps ---------------------------------------------------------------------------------- */

struct fmu3_step fmu3_try_step(fmi3Instance instance, double time, double step) {
    struct fmu3_step done = {.event = true, .terminate = true, .early = true, .reached = -1.0};
    done.status = fmu3.DoStep(instance, time, step, true, &done.event, &done.terminate, &done.early,
                              &done.reached);
    return done;
}

void fmu3_step(fmi3Instance instance, double time, double step) {
    const struct fmu3_step done = fmu3_try_step(instance, time, step);
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi3OK, done.status, importer.texts);
    TEST_ASSERT_FALSE(done.event || done.terminate || done.early);
    TEST_ASSERT_TRUE(done.reached == time + step);
}
