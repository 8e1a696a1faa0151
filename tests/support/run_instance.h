/* An instance of the model whose description is linked to the test, created and destroyed for each
 * test of the file. */
#ifndef RUN_INSTANCE_H
#define RUN_INSTANCE_H

#include "instance.h"
#include "last_text.h"
#include "model_description.h"
#include "stepping.h"
#include "values.h"

#include <math.h>
#include <unity.h>

static struct instance *instance;

static inline void create_instance(void) {
    ASSERT_OK(instance_create(&model_description, &last_text_sink, &instance));
}

void tearDown(void) {
    instance_destroy(instance);
}

static inline double get(unsigned reference) {
    double value = NAN;
    ASSERT_OK(instance_get_real(instance, &reference, 1, &value));
    return value;
}

static inline void set(unsigned reference, double value) {
    ASSERT_OK(instance_set_real(instance, &reference, 1, &value));
}

static inline void set_integer(unsigned reference, int value) {
    ASSERT_OK(instance_set_integer(instance, &reference, 1, &value));
}

/* From the time 0; tolerance 0: the model's. */
static inline void initialize(double tolerance) {
    const struct instance_experiment experiment = {.tolerance_defined = tolerance > 0.0,
                                                   .tolerance = tolerance};
    ASSERT_OK(instance_setup_experiment(instance, &experiment));
    ASSERT_OK(instance_enter_initialization(instance));
    ASSERT_OK(instance_exit_initialization(instance));
}

static inline void step_to(double t) {
    ASSERT_OK(
        instance_do_step(instance, instance_time(instance), t - instance_time(instance), NULL));
}

#endif
