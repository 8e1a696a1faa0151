/* A step that is discarded leaves the instance as it was before the call: whatever comes after has
 * the bits of a run without that step. FMI 3.0, section 2.2.4 (fmi3Discard). */
#include "each_method.h"
#include "fmu3_harness.h"

#include <math.h>
#include <stdio.h>
#include <unity.h>

static const fmi3ValueReference inputs[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2};
/* All that an importer can see. */
struct seen {
    struct fmu_values values;
    double derivatives[2];
};

/* Of the last instance made. */
static struct seen look(void) {
    static const fmi3Int32 orders[] = {1, 2};
    static const fmi3ValueReference derived[] = {RP_MANIPULATOR_ddq1, RP_MANIPULATOR_ee_x};
    struct seen seen;
    ASSERT_OK(fmu_get_all(importer.component, &seen.values));
    ASSERT_OK(
        fmu3.GetOutputDerivatives(importer.instance, derived, 2, orders, seen.derivatives, 2));
    return seen;
}

/* ---- Failing steps -------------------------------------------------------------------------- */

enum { STEPS = 60 };

static const double h = 0.02; // s

static void moving_inputs(struct fmu3_importer *of, const struct fmu3_update *update) {
    if (update->set) {
        const double u[] = {3.0 * sin(7.0 * update->time), 2.0 * cos(5.0 * update->time)};
        (void)fmu3.SetFloat64(of->instance, inputs, 2, u, 2);
    }
}

/* Some steps change an input, some a parameter, some nothing. */
static void prepare(fmi3Instance instance, int i) {
    if (i % 5 == 1) {
        fmu3_set(instance, RP_MANIPULATOR_tau1, i % 7 - 3.0);
    } else if (i % 11 == 7) {
        fmu3_set(instance, RP_MANIPULATOR_m2, 1.0 + 0.01 * i);
    }
}

/* Internal steps that are enough for a step of h and too few for 500 s. */
static const int largest[] = {0, 60, 400, 60, 5}; // by solver_method

static fmi3Instance begin(int with_method, const struct fmu3_options *options) {
    const fmi3Instance instance = fmu3_co_simulation(options);
    fmu3_set_method(instance, with_method);
    fmu3_set_int32(instance, RP_MANIPULATOR_max_internal_steps, largest[with_method]);
    fmu3_set(instance, RP_MANIPULATOR_dq1, 1.0);
    fmu3_initialize(instance, 0.0);
    return instance;
}

/* Too long for its internal steps. */
static void fail(fmi3Instance instance, double time) {
    const struct seen before = look();
    const struct fmu3_step step = fmu3_try_step(instance, time, 500.0);
    ASSERT_DISCARD(step.status);
    TEST_ASSERT_TRUE(step.event && step.terminate && step.early && step.reached == -1.0);
    const struct seen after = look();
    TEST_ASSERT_EQUAL_MEMORY(&before, &after, sizeof before);
}

static void run(fmi3Instance instance, bool fails, struct seen seen[STEPS]) {
    for (int i = 0; i < STEPS; i++) {
        if (fails && i % 3 == 0) {
            fail(instance, i * h); // with what the last step was done with
        }
        prepare(instance, i);
        if (fails && i % 2 == 0) {
            fail(instance, i * h); // with what the next one is done with
        }
        fmu3_step(instance, i * h, h);
        seen[i] = look();
    }
}

static void compare_runs(int with_method, const struct fmu3_options *options) {
    static struct seen plain[STEPS];
    static struct seen with_failures[STEPS];
    run(begin(with_method, options), false, plain);
    run(begin(with_method, options), true, with_failures);
    for (int i = 0; i < STEPS; i++) {
        char text[32];
        snprintf(text, sizeof text, "step %d", i);
        TEST_ASSERT_EQUAL_MEMORY_MESSAGE(&plain[i], &with_failures[i], sizeof plain[i], text);
    }
}

EACH_METHOD static void test_the_rest_of_the_run_has_the_same_bits(void) {
    compare_runs(method, NULL);
}

EACH_METHOD static void test_it_has_them_with_intermediate_updates_too(void) {
    static const struct fmu3_options options = {.intermediate_updates = true,
                                                .early_return = true,
                                                .required = inputs,
                                                .required_count = FMU_COUNT(inputs)};
    importer.update = moving_inputs;
    compare_runs(method, &options);
}

/* The first slope overflows; a step with another input follows. */
EACH_METHOD static void test_a_model_that_cannot_be_evaluated(void) {
    struct seen seen[2];
    for (int fails = 0; fails < 2; fails++) {
        const fmi3Instance instance = begin(method, NULL);
        fmu3_step(instance, 0.0, 0.1);
        if (fails) {
            fmu3_set(instance, RP_MANIPULATOR_tau1, 1.7e308);
            ASSERT_DISCARD(fmu3_try_step(instance, 0.1, 0.1).status);
        }
        fmu3_set(instance, RP_MANIPULATOR_tau1, 2.0);
        fmu3_step(instance, 0.1, 0.1);
        seen[fails] = look();
    }
    TEST_ASSERT_EQUAL_MEMORY(&seen[0], &seen[1], sizeof seen[0]);
}

/* Values of an input in between that no polynomial goes through. */
static double extreme;

static void extreme_inputs(struct fmu3_importer *of, const struct fmu3_update *update) {
    if (update->set) {
        const double u[] = {update->time > 0.14 ? extreme : -extreme, 0.0};
        (void)fmu3.SetFloat64(of->instance, inputs, 2, u, 2);
    }
}

static void test_inputs_whose_polynomial_overflows(void) {
    static const struct fmu3_options options = {
        .intermediate_updates = true, .required = inputs, .required_count = FMU_COUNT(inputs)};
    struct seen seen[2];
    for (int fails = 0; fails < 2; fails++) {
        extreme = 0.0;
        importer.update = extreme_inputs;
        const fmi3Instance instance = begin(1, &options);
        fmu3_step(instance, 0.0, 0.1);
        if (fails) {
            extreme = 1.7e308;
            ASSERT_DISCARD(fmu3_try_step(instance, 0.1, 0.1).status);
            extreme = 0.0;
        }
        fmu3_step(instance, 0.1, 0.1);
        seen[fails] = look();
    }
    TEST_ASSERT_EQUAL_MEMORY(&seen[0], &seen[1], sizeof seen[0]);
}

/* After a state was restored, whose history is not replayed yet. */
EACH_METHOD static void test_a_failed_step_right_after_a_rollback(void) {
    struct seen seen[2];
    for (int fails = 0; fails < 2; fails++) {
        fmi3FMUState state = NULL;
        const fmi3Instance instance = begin(method, NULL);
        fmu3_step(instance, 0.0, 0.1);
        fmu3_step(instance, 0.1, 0.05);
        ASSERT_OK(fmu3.GetFMUState(instance, &state));
        fmu3_step(instance, 0.15, 0.1);
        ASSERT_OK(fmu3.SetFMUState(instance, state));
        if (fails) {
            fail(instance, 0.15);
            fail(instance, 0.15);
        }
        fmu3_step(instance, 0.15, 0.2);
        seen[fails] = look();
    }
    TEST_ASSERT_EQUAL_MEMORY(&seen[0], &seen[1], sizeof seen[0]);
}
