#include "fmu3_harness.h"

#include <unity.h>

struct fmu3_importer importer;

static fmi2Component components[128]; /* whose instances are open */

void suiteSetUp(void) {
    fmu_load();
}

void setUp(void) {
    fmu_log_clear(&messages);
    importer = (struct fmu3_importer){0};
}

void tearDown(void) {
    for (size_t i = 0; i < FMU_COUNT(components); i++) {
        components[i] = NULL;
    }
    fmu_tear_down(&messages);
}

/* ---- Instances ------------------------------------------------------------------------------ */

static void update(fmi3InstanceEnvironment environment, fmi3Float64 time, fmi3Boolean set,
                   fmi3Boolean get, fmi3Boolean finished, fmi3Boolean can_return_early,
                   fmi3Boolean *return_early, fmi3Float64 *early_time) {
    const struct fmu3_update said = {time,         set,       get, finished, can_return_early,
                                     return_early, early_time};
    importer.updates++;
    if (importer.update != NULL) {
        importer.update(&importer, &said);
    }
}

static fmi3Instance instantiate(fmi2Type type) {
    size_t i = 0;
    while (components[i] != NULL) {
        i++;
        TEST_ASSERT_LESS_THAN_size_t(FMU_COUNT(components), i);
    }
    components[i] = fmu_instantiate_as(type, &messages, false);
    importer.component = components[i];
    importer.instance = fmu_fmi3_instance(components[i]);
    return importer.instance;
}

fmi3Instance fmu3_co_simulation(const struct fmu3_options *options) {
    if (options != NULL) {
        fmu_fmi3_options = (struct fmu_fmi3_options){
            .event_mode = options->event_mode,
            .early_return = options->early_return,
            .update = options->intermediate_updates ? update : NULL,
            .required = options->required,
            .required_count = options->required_count,
        };
    }
    const fmi3Instance instance = instantiate(fmi2CoSimulation);
    fmu_fmi3_options = (struct fmu_fmi3_options){0};
    return instance;
}

fmi3Instance fmu3_model_exchange(void) {
    return instantiate(fmi2ModelExchange);
}

void fmu3_free(fmi3Instance instance) {
    for (size_t i = 0; i < FMU_COUNT(components); i++) {
        if (components[i] != NULL && fmu_fmi3_instance(components[i]) == instance) {
            fmu_free(components[i]);
            components[i] = NULL;
            return;
        }
    }
    fmu3.FreeInstance(instance); // NULL, or one that the test has made
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

void fmu3_get_states(fmi3Instance instance, double x[FMU_STATES]) {
    ASSERT_OK(fmu3.GetFloat64(instance, fmu_state_references, FMU_STATES, x, FMU_STATES));
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
    TEST_ASSERT_EQUAL_INT_MESSAGE(fmi3OK, done.status, messages.texts);
    TEST_ASSERT_FALSE(done.event || done.terminate || done.early);
    TEST_ASSERT_TRUE(done.reached == time + step);
}
