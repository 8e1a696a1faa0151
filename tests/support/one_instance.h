/* An instance of the core for each test: what the tests of src/instance share. */
#ifndef ONE_INSTANCE_H
#define ONE_INSTANCE_H

#include "derivatives.h"
#include "instance.h"
#include "last_text.h"
#include "state.h"
#include "stepping.h"
#include "values.h"

#include <math.h>
#include <string.h>
#include <unity.h>

static struct instance *instance;

void tearDown(void) {
    instance_destroy(instance);
    instance = NULL;
}

/* The text of the last message contains this; it is then forgotten. */
static inline void assert_text(const char *text) {
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(last_text, text), last_text);
    last_text[0] = '\0';
}

/* ---- Values --------------------------------------------------------------------------------- */

static inline double get_of(struct instance *from, unsigned reference) {
    double value = NAN;
    ASSERT_OK(instance_get_real(from, &reference, 1, &value));
    return value;
}

static inline double get(unsigned reference) {
    return get_of(instance, reference);
}

static inline int get_int(unsigned reference) {
    int value = -1;
    ASSERT_OK(instance_get_integer(instance, &reference, 1, &value));
    return value;
}

static inline void set_of(struct instance *to, unsigned reference, double value) {
    ASSERT_OK(instance_set_real(to, &reference, 1, &value));
}

static inline void set(unsigned reference, double value) {
    set_of(instance, reference, value);
}

static inline void set_int(unsigned reference, int value) {
    ASSERT_OK(instance_set_integer(instance, &reference, 1, &value));
}

static inline void set_input_derivative(unsigned input, int order, double value) {
    ASSERT_OK(instance_set_input_derivatives(instance, &input, 1, &order, &value));
}

/* ---- Life ----------------------------------------------------------------------------------- */

static inline struct instance *created(const struct model_description *description) {
    struct instance *made = NULL;
    ASSERT_OK(instance_create(description, &last_text_sink, &made));
    return made;
}

/* In place of the one that there may be. */
static inline void create(const struct model_description *description) {
    tearDown();
    instance = created(description);
    last_text[0] = '\0';
}

static inline void setup(struct instance *started, double start, double stop) {
    const struct instance_experiment experiment = {
        .start_time = start, .stop_time_defined = isfinite(stop), .stop_time = stop};
    ASSERT_OK(instance_setup_experiment(started, &experiment));
}

/* Through initialization, from start to stop (s); INFINITY: no stop time. */
static inline void initialize_of(struct instance *started, double start, double stop) {
    setup(started, start, stop);
    ASSERT_OK(instance_enter_initialization(started));
    ASSERT_OK(instance_exit_initialization(started));
}

static inline void initialize_at(double start) {
    initialize_of(instance, start, INFINITY);
}

#endif
