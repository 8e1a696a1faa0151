/* An instance of the wheel in initialization mode, for each test of the core with it. */
#ifndef WHEEL_INSTANCE_H
#define WHEEL_INSTANCE_H

#include "model_description.h"
#include "one_instance.h"
#include "value_references.h"
#include "wheel.h"

static inline struct instance *initializing(void) {
    struct instance *made = created(&model_description);
    setup(made, 0.0, INFINITY);
    ASSERT_OK(instance_enter_initialization(made));
    return made;
}

void setUp(void) {
    last_text[0] = '\0';
    instance = initializing();
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

static inline struct wheel_values *values_of(struct instance *of) {
    return (void *)of->memory.values;
}

#endif
