/* An instance of the wheel in initialization mode, for each test of the core with it. */
#ifndef WHEEL_INSTANCE_H
#define WHEEL_INSTANCE_H

#include "instance.h"
#include "internals.h"
#include "last_text.h"
#include "model_description.h"
#include "value_references.h"
#include "values.h"
#include "wheel.h"

#include <math.h>
#include <string.h>
#include <unity.h>

static struct instance *instance;

static inline struct instance *initializing(void) {
    struct instance *created = NULL;
    const struct instance_experiment experiment = {.start_time = 0.0};
    ASSERT_OK(instance_create(&model_description, &last_text_sink, &created));
    ASSERT_OK(instance_setup_experiment(created, &experiment));
    ASSERT_OK(instance_enter_initialization(created));
    return created;
}

void setUp(void) {
    memset(last_text, 0, sizeof last_text);
    instance = initializing();
}

void tearDown(void) {
    instance_destroy(instance);
}

static inline void set_real(unsigned reference, double value) {
    ASSERT_OK(instance_set_real(instance, &reference, 1, &value));
}

static inline double get_real(struct instance *from, unsigned reference) {
    double value = NAN;
    ASSERT_OK(instance_get_real(from, &reference, 1, &value));
    return value;
}

static inline enum status set_boolean(unsigned reference, int value) {
    return instance_set_boolean(instance, &reference, 1, &value);
}

static inline int get_boolean(struct instance *from, unsigned reference) {
    int value = -1;
    ASSERT_OK(instance_get_boolean(from, &reference, 1, &value));
    return value;
}

static inline int get_int32(struct instance *from, unsigned reference) {
    int value = -1;
    ASSERT_OK(instance_get_int32(from, &reference, 1, &value));
    return value;
}

static inline void assert_text(const char *text) {
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(last_text, text), last_text);
    last_text[0] = '\0';
}

static inline struct wheel_values *values_of(struct instance *of) {
    return (void *)of->memory.values;
}

#endif
