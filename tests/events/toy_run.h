/* Runs a toy: what its tests share. */
#ifndef TOY_RUN_H
#define TOY_RUN_H

#include "one_instance.h"
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

/* Steps of h from the time t on, which must be the instance's. */
static inline void run(double t, double h, int steps) {
    for (int i = 0; i < steps; i++) {
        ASSERT_OK(instance_do_step(instance, t + i * h, h));
    }
}

#endif
