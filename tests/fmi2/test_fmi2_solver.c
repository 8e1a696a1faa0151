/* The parameters of the integrator: solver_method and max_step. That all methods give the same
 * motion: rparm/test_accuracy.py. */
#include "each_method.h"
#include "fmu_harness.h"

#include <math.h>
#include <unity.h>

/* ---- The method ----------------------------------------------------------------------------- */

EACH_METHOD static void test_the_order_is_one_of_the_method(void) {
    static const int highest[FMU_METHODS] = {
        [FMU_CVODE_ADAMS] = 12, [FMU_CVODE_BDF] = 5, [FMU_ERK] = 5, [FMU_TAYLOR] = 31};
    static const int lowest_of_last[FMU_METHODS] = {
        [FMU_CVODE_ADAMS] = 6, [FMU_CVODE_BDF] = 3, [FMU_ERK] = 5, [FMU_TAYLOR] = 12};
    const fmi2Component c = fmu_instantiate(&messages, false);
    fmu_set_integer(c, RP_MANIPULATOR_solver_method, method);
    fmu_set(c, RP_MANIPULATOR_dq1, 2.0);
    fmu_initialize(c, 0.0, 1e-10);
    for (int i = 0; i < 100; i++) {
        ASSERT_OK(fmu.DoStep(c, 0.01 * i, 0.01, fmi2True));
        TEST_ASSERT_LESS_OR_EQUAL_INT(highest[method],
                                      fmu_get_integer(c, RP_MANIPULATOR_solver_last_order));
    }
    TEST_ASSERT_GREATER_OR_EQUAL_INT(lowest_of_last[method],
                                     fmu_get_integer(c, RP_MANIPULATOR_solver_last_order));
}

/* A reset solver keeps nothing: the same method again, after failed steps of all kinds. */
EACH_METHOD static void test_a_reset_leaves_nothing_of_what_failed(void) {
    static const struct {
        fmi2ValueReference reference;
        double value, length;
    } failures[] = {{RP_MANIPULATOR_dq1, 1e160, 0.1},     {RP_MANIPULATOR_dq2, 1e200, 0.1},
                    {RP_MANIPULATOR_f2, 1e300, 0.1},      {RP_MANIPULATOR_dq1, 1.0, 1e-160},
                    {RP_MANIPULATOR_dq1, 1.0, 1e300},     {RP_MANIPULATOR_tau1, 1.7e308, 1.0},
                    {RP_MANIPULATOR_max_step, 1e-20, 1.0}};
    static struct fmu_run expected;
    static struct fmu_run again;
    const fmi2Component fresh = fmu_instantiate(&messages, false);
    fmu_set_integer(fresh, RP_MANIPULATOR_solver_method, method);
    ASSERT_OK(fmu_run(fresh, 0, &expected));

    const fmi2Component c = fmu_instantiate(&messages, false);
    for (size_t i = 0; i < FMU_COUNT(failures); i++) {
        fmu_set_integer(c, RP_MANIPULATOR_solver_method, method);
        fmu_set(c, failures[i].reference, failures[i].value);
        fmu_initialize(c, 0.0, 0.0);
        // solvers square their step; the Taylor method has no step that is too short
        const bool is_done = method == FMU_TAYLOR && failures[i].length < 1e-100;
        TEST_ASSERT_EQUAL_INT(is_done ? fmi2OK : fmi2Discard,
                              fmu.DoStep(c, 0.0, failures[i].length, fmi2True));
        ASSERT_OK(fmu.Reset(c));
        fmu_set_integer(c, RP_MANIPULATOR_solver_method, method);
        ASSERT_OK(fmu_run(c, 0, &again));
        TEST_ASSERT_EQUAL_MEMORY(&expected, &again, sizeof expected);
        ASSERT_OK(fmu.Reset(c));
    }
}

/* CVODE goes past communication points with held inputs, the Taylor method too, from a restart for
 * each step; the Runge-Kutta method ends there. */
EACH_METHOD static void test_internal_steps_over_communication_points(void) {
    enum { STEPS = 1000 };
    const double h = 1.0 / 1024.0;
    const fmi2Component c = fmu_initialized_with(method, &messages, 0.0);
    for (int i = 0; i < STEPS; i++) {
        ASSERT_OK(fmu.DoStep(c, i * h, h, fmi2True));
    }
    const int steps = fmu_get_integer(c, RP_MANIPULATOR_solver_steps);
    if (method == FMU_ERK) {
        TEST_ASSERT_GREATER_OR_EQUAL_INT(STEPS, steps);
        TEST_ASSERT_EQUAL_INT(STEPS, fmu_get_integer(c, RP_MANIPULATOR_solver_restarts));
    } else {
        TEST_ASSERT_LESS_THAN_INT(STEPS, steps);
        TEST_ASSERT_EQUAL_INT(method == FMU_TAYLOR ? steps : 1,
                              fmu_get_integer(c, RP_MANIPULATOR_solver_restarts));
        TEST_ASSERT_TRUE(fmu_get(c, RP_MANIPULATOR_solver_last_step) > h);
    }
}

/* ---- The limit ------------------------------------------------------------------------------ */

/* Steps in which nothing, inputs or derivatives change in turn; the last values are those after
 * them. */
static void run(fmi2Component c, double h, double limit, struct fmu_values *values) {
    const fmi2ValueReference f2 = RP_MANIPULATOR_f2;
    const fmi2Integer first = 1;
    const double slope = 3.0;
    for (int i = 0; i < 60; i++) {
        if (i % 10 > 5) {
            fmu_set(c, RP_MANIPULATOR_tau1, i % 7);
        }
        if (i % 10 > 7) {
            ASSERT_OK(fmu.SetRealInputDerivatives(c, &f2, 1, &first, &slope));
        }
        ASSERT_OK(fmu.DoStep(c, i * h, h, fmi2True));
        TEST_ASSERT_TRUE(fmu_get(c, RP_MANIPULATOR_solver_last_step) <= limit * (1.0 + 1e-9));
    }
    ASSERT_OK(fmu_get_all(c, values));
}

static fmi2Component limited(double limit) {
    const fmi2Component c = fmu_instantiate(&messages, false);
    fmu_set_integer(c, RP_MANIPULATOR_solver_method, method);
    fmu_set(c, RP_MANIPULATOR_max_step, limit);
    fmu_initialize(c, 0.0, 1e-4);
    return c;
}

EACH_METHOD static void test_no_internal_step_is_longer_than_the_limit(void) {
    static const double limits[] = {1e-4, 1e-3, 0.01, 0.05};
    static const double lengths[] = {1.0 / 128.0, 0.25};
    struct fmu_values values;
    for (size_t i = 0; i < FMU_COUNT(limits) * FMU_COUNT(lengths); i++) {
        const double limit = limits[i / FMU_COUNT(lengths)];
        const double h = lengths[i % FMU_COUNT(lengths)];
        const fmi2Component c = limited(limit);
        run(c, h, limit, &values);
        TEST_ASSERT_TRUE(fmu_get_integer(c, RP_MANIPULATOR_solver_steps) * limit >=
                         60.0 * h * (1.0 - 1e-9));
        fmu_free(c);
    }
}

EACH_METHOD static void test_no_limit_and_one_that_is_not_reached_change_nothing(void) {
    struct fmu_values expected;
    struct fmu_values values;
    const fmi2Component plain = fmu_instantiate(&messages, false);
    fmu_set_integer(plain, RP_MANIPULATOR_solver_method, method);
    fmu_initialize(plain, 0.0, 1e-4);
    run(plain, 0.25, INFINITY, &expected);

    const fmi2Component unset = fmu_instantiate(&messages, false);
    fmu_set_integer(unset, RP_MANIPULATOR_solver_method, method);
    fmu_set(unset, RP_MANIPULATOR_max_step, 0.01);
    fmu_set(unset, RP_MANIPULATOR_max_step, 0.0);
    fmu_initialize(unset, 0.0, 1e-4);
    run(unset, 0.25, INFINITY, &values);
    fmu_assert_same_values(&expected, &values, "a limit taken back");

    const fmi2Component wide = limited(1e6);
    run(wide, 0.25, INFINITY, &values);
    for (size_t i = 0; i < fmu_variable_count; i++) {
        if (fmu_variables[i].reference == RP_MANIPULATOR_max_step) {
            values.reals[i] = 0.0;
        }
    }
    fmu_assert_same_values(&expected, &values, "a limit of 1e6 s");
}

/* A limit so short that a step cannot end. */
EACH_METHOD static void test_a_limit_that_is_too_short_is_told(void) {
    static const double limits[] = {1e-7, 1e-20, 1e-300, 5e-324};
    for (size_t i = 0; i < FMU_COUNT(limits); i++) {
        const fmi2Component c = limited(limits[i]);
        fmu_log_clear(&messages);
        ASSERT_DISCARD(fmu.DoStep(c, 0.0, 1.0, fmi2True));
        TEST_ASSERT_GREATER_THAN_UINT(0, messages.count[fmi2Discard]);
        TEST_ASSERT_TRUE(fmu_get(c, RP_MANIPULATOR_time) < 1.0);
        TEST_ASSERT_TRUE(isfinite(fmu_get(c, RP_MANIPULATOR_q1)));
        fmu_assert_reset_is_fresh(c, "after a limit that is too short");
        fmu_free(c);
    }
}
