/* Runs a toy: what its tests share. */
#ifndef TOY_RUN_H
#define TOY_RUN_H

#include "instance.h"
#include "last_text.h"
#include "snapshot.h"
#include "stepping.h"
#include "toy.h"
#include "values.h"

#include <math.h>
#include <unity.h>

static struct instance *toy;

static double get(unsigned reference) {
    double value = NAN;
    ASSERT_OK(instance_get_real(toy, &reference, 1, &value));
    return value;
}

static int get_int(unsigned reference) {
    int value = -1;
    ASSERT_OK(instance_get_integer(toy, &reference, 1, &value));
    return value;
}

static void set(unsigned reference, double value) {
    ASSERT_OK(instance_set_real(toy, &reference, 1, &value));
}

static void set_int(unsigned reference, int value) {
    ASSERT_OK(instance_set_integer(toy, &reference, 1, &value));
}

static void create(const struct model_description *description) {
    instance_destroy(toy);
    toy = NULL;
    ASSERT_OK(instance_create(description, &last_text_sink, &toy));
}

/* With a method, at a tolerance. */
static void prepare(const struct model_description *description, int method, double tolerance) {
    const struct instance_experiment experiment = {0};
    create(description);
    ASSERT_OK(instance_setup_experiment(toy, &experiment));
    set_int(TOY_METHOD, method);
    set(TOY_TOLERANCE, tolerance);
}

static void initialize(void) {
    ASSERT_OK(instance_enter_initialization(toy));
    ASSERT_OK(instance_exit_initialization(toy));
}

/* Steps of h from the time t on, which must be the instance's. */
static void run(double t, double h, int steps) {
    for (int i = 0; i < steps; i++) {
        ASSERT_OK(instance_do_step(toy, t + i * h, h));
    }
}

#endif
