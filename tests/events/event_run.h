/* Runs the model of a test: what the tests of events share. */
#ifndef EVENT_RUN_H
#define EVENT_RUN_H

#include "continuous_states.h"
#include "equations.h"
#include "model_description.h"
#include "one_instance.h"
#include "serialization.h"
#include "snapshot.h"
#include "value_references.h"

/* References of the variables that every model with events has. */
static inline unsigned own(const char *name) {
    for (size_t i = 0; i < model_description.variable_count; i++) {
        if (strcmp(model_description.variables[i].name, name) == 0) {
            return model_description.variables[i].reference;
        }
    }
    TEST_FAIL_MESSAGE(name);
    return 0;
}

static inline int event_count(void) {
    return get_int(own("event_count"));
}

static inline double last_event_time(void) {
    return get(own("last_event_time"));
}

/* With a method, at a tolerance; the experiment starts at start (s). */
static inline void prepare_as(const struct model_description *description, double start,
                              int with_method, double tolerance) {
    create(description);
    setup(instance, start, INFINITY);
    set_int(own("solver_method"), with_method);
    set(own("relative_tolerance"), tolerance);
}

static inline void prepare(int with_method, double tolerance) {
    prepare_as(&model_description, 0.0, with_method, tolerance);
}

static inline void initialize(void) {
    ASSERT_OK(instance_enter_initialization(instance));
    ASSERT_OK(instance_exit_initialization(instance));
}

/* For an integrator outside, which begins. */
static inline void begin_outside(void) {
    instance_integrate_outside(instance);
    initialize();
    ASSERT_OK(instance_enter_continuous_time(instance));
}

/* Steps of h from the time t on, which must be the instance's. */
static inline void run(double t, double h, int steps) {
    for (int i = 0; i < steps; i++) {
        ASSERT_OK(instance_do_step(instance, t + i * h, h, NULL));
    }
}

/* Serializes the instance as it is and reads the bytes. */
static inline enum status pass_on(void) {
    struct instance_snapshot *snapshot = NULL;
    struct instance_snapshot *read = NULL;
    unsigned char bytes[2000];
    const size_t size = instance_serialized_size(instance);
    TEST_ASSERT_LESS_OR_EQUAL_size_t(sizeof bytes, size);
    ASSERT_OK(instance_save(instance, 0, &snapshot));
    ASSERT_OK(instance_serialize(instance, snapshot, bytes, size));
    last_text[0] = '\0';
    return instance_deserialize(instance, bytes, size, &read);
}

/* A state with this mode, now and since the restart or now only, is refused. */
static inline void assert_forged(int *now, int *since_restart, int mode, const char *text) {
    const int kept = *now;
    *now = *since_restart = mode;
    ASSERT_REFUSED(pass_on());
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(last_text, text), last_text);
    *since_restart = kept;
    ASSERT_REFUSED(pass_on());
    *now = kept;
    ASSERT_OK(pass_on());
}

#endif
