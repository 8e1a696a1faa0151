/* Runs a toy: what its tests share. */
#ifndef TOY_RUN_H
#define TOY_RUN_H

#include "continuous_states.h"
#include "one_instance.h"
#include "serialization.h"
#include "snapshot.h"
#include "toy.h"

/* With a method, at a tolerance; the experiment starts at start (s). */
static inline void prepare_at(double start, const struct model_description *description,
                              int with_method, double tolerance) {
    create(description);
    setup(instance, start, INFINITY);
    set_int(TOY_METHOD, with_method);
    set(TOY_TOLERANCE, tolerance);
}

static inline void prepare(const struct model_description *description, int with_method,
                           double tolerance) {
    prepare_at(0.0, description, with_method, tolerance);
}

static inline void initialize(void) {
    ASSERT_OK(instance_enter_initialization(instance));
    ASSERT_OK(instance_exit_initialization(instance));
}

/* For an integrator outside, which begins. */
static inline void prepare_outside(const struct model_description *description) {
    prepare(description, 1, 1e-8);
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

/* ---- Forged modes ---------------------------------------------------------------------------- */

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

/* Brings a toy to where it moves within the integrator's history. */
static inline void start_moving(const struct model_description *description) {
    prepare(description, 1, 1e-8);
    set(TOY_POSITION, 1.0);
    set(TOY_SPEED, 2.0);
    initialize();
    run(0.0, 1e-3, 2);
    TEST_ASSERT_TRUE(instance->state.has_history && get(TOY_POSITION) > 1.0 &&
                     get_int(TOY_EVENTS) == 0);
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
