/* Inputs that are polynomials over a step. FMI 2.0, section 4.2.1. */
#include "fmu_polynomials.h"

#include <float.h>
#include <limits.h>
#include <math.h>
#include <unity.h>

static fmi2Status derive(fmi2Component c, fmi2ValueReference reference, fmi2Integer order,
                         double value) {
    return fmu.SetRealInputDerivatives(c, &reference, 1, &order, &value);
}

static void step(fmi2Component c, double time, double length) {
    ASSERT_OK(fmu.DoStep(c, time, length, fmi2True));
}

/* ---- A slide that is not coupled to the rotation --------------------------------------------- */

/* Position and speed after s seconds with the force p, from q2 and dq2. */
static void assert_slid(fmi2Component c, const struct fmu_polynomial *p, double s, double q2,
                        double dq2) {
    // in FMI 3.0 the times at which the input is asked for are rounded
    const double time = fmu_get(c, RP_MANIPULATOR_time);
    const double tolerance = 1e-11 + (fmu_version == 3 ? 20.0 * DBL_EPSILON * fabs(time) : 0.0);
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, dq2 + fmu_polynomial_integral(p, 1, s) / fmu_slide_mass,
                              fmu_get(c, RP_MANIPULATOR_dq2));
    TEST_ASSERT_DOUBLE_WITHIN(tolerance,
                              q2 + dq2 * s + fmu_polynomial_integral(p, 2, s) / fmu_slide_mass,
                              fmu_get(c, RP_MANIPULATOR_q2));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, fmu_get(c, RP_MANIPULATOR_q1));
}

static void test_every_order_counts(void) {
    static const double starts[] = {0.0, -2.5, 1048576.0};
    for (size_t i = 0; i < FMU_SLIDE_FORCES * FMU_COUNT(starts); i++) {
        const struct fmu_polynomial *force = &fmu_slide_forces[i % FMU_SLIDE_FORCES];
        const double start = starts[i / FMU_SLIDE_FORCES];
        const fmi2Component c = fmu_slide(&messages, start);
        fmu_slide_begin(c);
        fmu_set_polynomial(c, RP_MANIPULATOR_f2, force);
        step(c, start, 0.5);
        assert_slid(c, force, 0.5, 0.0, 0.0);
        fmu_free(c);
    }
}

static void test_derivatives_may_be_set_before_the_first_step(void) {
    const struct fmu_polynomial *force = &fmu_slide_forces[4];
    for (int mode = 0; mode < 3; mode++) {
        const fmi2Component c = fmu_slide(&messages, 0.0);
        if (mode == 0) { // instantiated
            fmu_set_polynomial(c, RP_MANIPULATOR_f2, force);
        }
        ASSERT_OK(fmu.EnterInitializationMode(c));
        if (mode == 1) {
            fmu_set_polynomial(c, RP_MANIPULATOR_f2, force);
        }
        ASSERT_OK(fmu.ExitInitializationMode(c));
        if (mode == 2) {
            fmu_set_polynomial(c, RP_MANIPULATOR_f2, force);
        }
        step(c, 0.0, 0.5);
        assert_slid(c, force, 0.5, 0.0, 0.0);
        fmu_free(c);
    }
}

static void test_what_is_not_refreshed_no_longer_applies(void) {
    const struct fmu_polynomial *force = &fmu_slide_forces[4];
    const struct fmu_polynomial held = {{force->d[0], 0.0, 0.0, 0.0}};
    const struct fmu_polynomial slope = {{force->d[0], 7.0, 0.0, 0.0}};
    const fmi2Component c = fmu_slide(&messages, 0.0);
    fmu_slide_begin(c);
    fmu_set_polynomial(c, RP_MANIPULATOR_f2, force);
    step(c, 0.0, 0.5);
    TEST_ASSERT_EQUAL_DOUBLE(force->d[0], fmu_get(c, RP_MANIPULATOR_f2));

    double q2 = fmu_get(c, RP_MANIPULATOR_q2);
    double dq2 = fmu_get(c, RP_MANIPULATOR_dq2);
    step(c, 0.5, 0.25); // nothing set: held at the last value set
    assert_slid(c, &held, 0.25, q2, dq2);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, force->d[0] / fmu_slide_mass, fmu_get(c, RP_MANIPULATOR_ddq2));

    q2 = fmu_get(c, RP_MANIPULATOR_q2);
    dq2 = fmu_get(c, RP_MANIPULATOR_dq2);
    ASSERT_OK(derive(c, RP_MANIPULATOR_f2, 1, 7.0));
    step(c, 0.75, 0.25); // only this order: the others are not back
    assert_slid(c, &slope, 0.25, q2, dq2);
}

/* A derivative of one input does not keep that of the other. */
static void test_inputs_are_refreshed_one_by_one(void) {
    const fmi2Component c = fmu_slide(&messages, 0.0);
    fmu_slide_begin(c);
    ASSERT_OK(derive(c, RP_MANIPULATOR_f2, 1, 4.0));
    step(c, 0.0, 0.5);
    const double dq2 = fmu_get(c, RP_MANIPULATOR_dq2);
    ASSERT_OK(derive(c, RP_MANIPULATOR_tau1, 1, 0.0));
    step(c, 0.5, 0.5);
    TEST_ASSERT_DOUBLE_WITHIN(1e-11, dq2, fmu_get(c, RP_MANIPULATOR_dq2));
}

static void test_the_order_of_calls_does_not_matter(void) {
    struct fmu_values first;
    struct fmu_values values;
    for (int variant = 0; variant < 4; variant++) {
        static const fmi2ValueReference references[][3] = {
            {RP_MANIPULATOR_f2, RP_MANIPULATOR_f2, RP_MANIPULATOR_tau1},
            {RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2, RP_MANIPULATOR_f2}};
        static const fmi2Integer orders[][3] = {{1, 3, 2}, {2, 3, 1}};
        static const double derivatives[][3] = {{3.0, 40.0, -8.0}, {-8.0, 40.0, 3.0}};
        const int sorted = variant % 2;
        const bool values_last = variant >= 2;
        const fmi2Component c = fmu_initialized(&messages, 0.0);
        step(c, 0.0, 0.125);
        if (!values_last) {
            fmu_set(c, RP_MANIPULATOR_f2, 5.0);
            fmu_set(c, RP_MANIPULATOR_tau1, -2.0);
        }
        ASSERT_OK(fmu.SetRealInputDerivatives(c, references[sorted], 3, orders[sorted],
                                              derivatives[sorted]));
        if (values_last) {
            fmu_set(c, RP_MANIPULATOR_tau1, -2.0);
            fmu_set(c, RP_MANIPULATOR_f2, 5.0);
        }
        step(c, 0.125, 0.125);
        ASSERT_OK(fmu_get_all(c, variant == 0 ? &first : &values));
        if (variant > 0) {
            fmu_assert_same_values(&first, &values, "another order of calls");
        }
        fmu_free(c);
    }
}

/* ---- Outputs after such a step -------------------------------------------------------------- */

static void test_outputs_use_the_polynomials_at_the_end(void) {
    const double h = 0.25;
    const fmi2Component c = fmu_swinging(&messages);
    fmu_set_polynomial(c, RP_MANIPULATOR_tau1, &fmu_torque);
    fmu_set_polynomial(c, RP_MANIPULATOR_f2, &fmu_force);
    step(c, 0.0, h);
    for (int again = 0; again < 2; again++) {
        const double tau1 = again ? 1.0 : fmu_polynomial_integral(&fmu_torque, 0, h);
        const double f2 = again ? -2.0 : fmu_polynomial_integral(&fmu_force, 0, h);
        fmu_assert_motion(c, tau1, f2, 1e-10);
        // reading an input gives what was set last
        TEST_ASSERT_EQUAL_DOUBLE(again ? 1.0 : fmu_torque.d[0], fmu_get(c, RP_MANIPULATOR_tau1));
        TEST_ASSERT_EQUAL_DOUBLE(again ? -2.0 : fmu_force.d[0], fmu_get(c, RP_MANIPULATOR_f2));
        fmu_set(c, RP_MANIPULATOR_tau1, 1.0);
        fmu_set(c, RP_MANIPULATOR_f2, -2.0);
    }
}

/* The same value set again is a set: the polynomial is over. */
static void test_setting_the_value_again_ends_the_polynomial(void) {
    const fmi2Component c = fmu_slide(&messages, 0.0);
    fmu_slide_begin(c);
    fmu_set_polynomial(c, RP_MANIPULATOR_f2, &fmu_slide_forces[4]);
    step(c, 0.0, 0.5);
    TEST_ASSERT_DOUBLE_WITHIN(
        1e-12, fmu_polynomial_integral(&fmu_slide_forces[4], 0, 0.5) / fmu_slide_mass,
        fmu_get(c, RP_MANIPULATOR_ddq2));
    fmu_set(c, RP_MANIPULATOR_f2, fmu_slide_forces[4].d[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, fmu_slide_forces[4].d[0] / fmu_slide_mass,
                              fmu_get(c, RP_MANIPULATOR_ddq2));
}

/* ---- Arguments that are refused ------------------------------------------------------------- */

static void test_input_derivatives_that_are_refused(void) {
    fmu_only_in(2, "FMI 3.0 has no derivatives of inputs");
    static const struct {
        fmi2ValueReference reference;
        fmi2Integer order;
        double value;
        fmi2Status status;
        const char *word; /* of the message */
    } cases[] = {
        {RP_MANIPULATOR_f2, 0, 1.0, fmi2Error, "0"},
        {RP_MANIPULATOR_f2, 4, 1.0, fmi2Error, "4"},
        {RP_MANIPULATOR_f2, -1, 1.0, fmi2Error, "-1"},
        {RP_MANIPULATOR_f2, INT_MAX, 1.0, fmi2Error, "order"},
        {RP_MANIPULATOR_f2, INT_MIN, 1.0, fmi2Error, "order"},
        {RP_MANIPULATOR_f2, 1, NAN, fmi2Discard, "f2"},
        {RP_MANIPULATOR_f2, 2, INFINITY, fmi2Discard, "f2"},
        {RP_MANIPULATOR_tau1, 3, -INFINITY, fmi2Discard, "tau1"},
        {9999, 1, 1.0, fmi2Error, "9999"},
        {UINT_MAX, 1, 1.0, fmi2Error, "4294967295"},
        {RP_MANIPULATOR_q1, 1, 1.0, fmi2Error, "q1"},
        {RP_MANIPULATOR_m1, 1, 1.0, fmi2Error, "m1"},
        {RP_MANIPULATOR_time, 1, 1.0, fmi2Error, "time"},
        {RP_MANIPULATOR_solver_steps, 1, 1.0, fmi2Error, "solver_steps"},
    };
    struct fmu_values expected;
    struct fmu_values values;
    const fmi2Component plain = fmu_initialized(&messages, 0.0);
    step(plain, 0.0, 0.25);
    ASSERT_OK(fmu_get_all(plain, &expected));
    for (size_t i = 0; i < FMU_COUNT(cases) * 2; i++) {
        const fmi2Component c = fmu_initialized(&messages, 0.0);
        // the good one of the two must not be taken either
        const size_t bad = i % 2;
        fmi2ValueReference references[] = {RP_MANIPULATOR_tau1, RP_MANIPULATOR_tau1};
        fmi2Integer orders[] = {1, 1};
        double derivatives[] = {5.0, 5.0};
        references[bad] = cases[i / 2].reference;
        orders[bad] = cases[i / 2].order;
        derivatives[bad] = cases[i / 2].value;
        fmu_log_clear(&messages);
        TEST_ASSERT_EQUAL_INT_MESSAGE(
            cases[i / 2].status, fmu.SetRealInputDerivatives(c, references, 2, orders, derivatives),
            cases[i / 2].word);
        TEST_ASSERT_EQUAL_UINT(1, messages.count[cases[i / 2].status]);
        fmu_assert_logged(&messages, cases[i / 2].word);
        if (cases[i / 2].status == fmi2Error) {
            fmu_assert_in_error(c);
            fmu_assert_reset_is_fresh(c, cases[i / 2].word);
        } else {
            step(c, 0.0, 0.25);
            ASSERT_OK(fmu_get_all(c, &values));
            fmu_assert_same_values(&expected, &values, cases[i / 2].word);
        }
        fmu_free(c);
    }
}
