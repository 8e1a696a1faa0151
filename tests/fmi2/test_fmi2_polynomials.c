/* Inputs that are polynomials over a step, and derivatives of outputs by the time after such a
 * step. FMI 2.0, section 4.2.1. */
#include "fmu_harness.h"

#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <unity.h>

/* Value and derivatives at the beginning of a step, per s^k. */
struct polynomial {
    double d[4];
};

/* Its integral of this order from 0 to s; 0: its value. */
static double integral(const struct polynomial *polynomial, int order, double s) {
    double sum = 0.0;
    for (int k = 0; k < 4; k++) {
        double term = polynomial->d[k];
        for (int i = 1; i <= k + order; i++) {
            term *= s / i;
        }
        sum += term;
    }
    return sum;
}

static fmi2Status derive(fmi2Component c, fmi2ValueReference reference, fmi2Integer order,
                         double value) {
    return fmu.SetRealInputDerivatives(c, &reference, 1, &order, &value);
}

static void set_polynomial(fmi2Component c, fmi2ValueReference reference,
                           const struct polynomial *polynomial) {
    fmu_set(c, reference, polynomial->d[0]);
    for (fmi2Integer k = 1; k < 4; k++) {
        if (polynomial->d[k] != 0.0) {
            ASSERT_OK(derive(c, reference, k, polynomial->d[k]));
        }
    }
}

static void step(fmi2Component c, double time, double length) {
    ASSERT_OK(fmu.DoStep(c, time, length, fmi2True));
}

static const double finest_tolerance = 1e-12;

/* The whole manipulator in motion, and inputs that move it a lot in 0.25 s. */
static const struct polynomial torque = {{6.0, -40.0, 300.0, -2000.0}};
static const struct polynomial force = {{-3.0, 25.0, 200.0, 5000.0}};

static fmi2Component swinging(void) {
    const fmi2Component c = fmu_instantiate(&messages, false);
    fmu_set(c, RP_MANIPULATOR_relative_tolerance, finest_tolerance);
    fmu_set(c, RP_MANIPULATOR_dq1, 2.0);
    fmu_set(c, RP_MANIPULATOR_dq2, -0.5);
    fmu_initialize(c, 0.0, 0.0);
    set_polynomial(c, RP_MANIPULATOR_tau1, &torque);
    set_polynomial(c, RP_MANIPULATOR_f2, &force);
    return c;
}

/* ---- A slide that is not coupled to the rotation --------------------------------------------- */

/* With a = 0 and g = 0, at rest in q1: q2'' = f2 / slide_mass. */
static const double slide_mass = 2.0; // kg

/* f2 with one order each, and with all at once. */
enum { ALL = 4, FORCES };
static const struct polynomial forces[FORCES] = {
    {{1.5, 0.0, 0.0, 0.0}},
    {{0.0, 4.0, 0.0, 0.0}},
    {{0.0, 0.0, -9.0, 0.0}},
    {{0.0, 0.0, 0.0, 30.0}},
    [ALL] = {{-1.0, 3.0, -20.0, 50.0}},
};

/* Instantiated, from 0 m at rest; the experiment is set up and starts at start (s). */
static fmi2Component slide(double start) {
    const fmi2Component c = fmu_instantiate(&messages, false);
    fmu_set(c, RP_MANIPULATOR_a, 0.0);
    fmu_set(c, RP_MANIPULATOR_g, 0.0);
    fmu_set(c, RP_MANIPULATOR_m2, slide_mass);
    fmu_set(c, RP_MANIPULATOR_relative_tolerance, finest_tolerance);
    ASSERT_OK(fmu.SetupExperiment(c, fmi2False, 0.0, start, fmi2False, 0.0));
    return c;
}

/* Between steps. */
static fmi2Component sliding(double start) {
    const fmi2Component c = slide(start);
    ASSERT_OK(fmu.EnterInitializationMode(c));
    ASSERT_OK(fmu.ExitInitializationMode(c));
    return c;
}

/* Position and speed after s seconds with the force p, from q2 and dq2. */
static void assert_slid(fmi2Component c, const struct polynomial *p, double s, double q2,
                        double dq2) {
    // in FMI 3.0 the times at which the input is asked for are rounded
    const double time = fmu_get(c, RP_MANIPULATOR_time);
    const double tolerance = 1e-11 + (fmu_version == 3 ? 20.0 * DBL_EPSILON * fabs(time) : 0.0);
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, dq2 + integral(p, 1, s) / slide_mass,
                              fmu_get(c, RP_MANIPULATOR_dq2));
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, q2 + dq2 * s + integral(p, 2, s) / slide_mass,
                              fmu_get(c, RP_MANIPULATOR_q2));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, fmu_get(c, RP_MANIPULATOR_q1));
}

static void test_every_order_counts(void) {
    static const double starts[] = {0.0, -2.5, 1048576.0};
    for (size_t i = 0; i < FORCES * FMU_COUNT(starts); i++) {
        const struct polynomial *pushed = &forces[i % FORCES];
        const double start = starts[i / FORCES];
        const fmi2Component c = sliding(start);
        set_polynomial(c, RP_MANIPULATOR_f2, pushed);
        step(c, start, 0.5);
        assert_slid(c, pushed, 0.5, 0.0, 0.0);
        fmu_free(c);
    }
}

static void test_derivatives_may_be_set_before_the_first_step(void) {
    const struct polynomial *pushed = &forces[ALL];
    for (int mode = 0; mode < 3; mode++) {
        const fmi2Component c = slide(0.0);
        if (mode == 0) { // instantiated
            set_polynomial(c, RP_MANIPULATOR_f2, pushed);
        }
        ASSERT_OK(fmu.EnterInitializationMode(c));
        if (mode == 1) {
            set_polynomial(c, RP_MANIPULATOR_f2, pushed);
        }
        ASSERT_OK(fmu.ExitInitializationMode(c));
        if (mode == 2) {
            set_polynomial(c, RP_MANIPULATOR_f2, pushed);
        }
        step(c, 0.0, 0.5);
        assert_slid(c, pushed, 0.5, 0.0, 0.0);
        fmu_free(c);
    }
}

static void test_what_is_not_refreshed_no_longer_applies(void) {
    const struct polynomial *pushed = &forces[ALL];
    const struct polynomial held = {{pushed->d[0], 0.0, 0.0, 0.0}};
    const struct polynomial slope = {{pushed->d[0], 7.0, 0.0, 0.0}};
    const fmi2Component c = sliding(0.0);
    set_polynomial(c, RP_MANIPULATOR_f2, pushed);
    step(c, 0.0, 0.5);
    TEST_ASSERT_EQUAL_DOUBLE(pushed->d[0], fmu_get(c, RP_MANIPULATOR_f2));

    double q2 = fmu_get(c, RP_MANIPULATOR_q2);
    double dq2 = fmu_get(c, RP_MANIPULATOR_dq2);
    step(c, 0.5, 0.25); // nothing set: held at the last value set
    assert_slid(c, &held, 0.25, q2, dq2);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, pushed->d[0] / slide_mass, fmu_get(c, RP_MANIPULATOR_ddq2));

    q2 = fmu_get(c, RP_MANIPULATOR_q2);
    dq2 = fmu_get(c, RP_MANIPULATOR_dq2);
    ASSERT_OK(derive(c, RP_MANIPULATOR_f2, 1, 7.0));
    step(c, 0.75, 0.25); // only this order: the others are not back
    assert_slid(c, &slope, 0.25, q2, dq2);
}

/* A derivative of one input does not keep the other one's. */
static void test_inputs_are_refreshed_one_by_one(void) {
    const fmi2Component c = sliding(0.0);
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
    const fmi2Component c = swinging();
    step(c, 0.0, h);
    for (int again = 0; again < 2; again++) {
        const double tau1 = again ? 1.0 : integral(&torque, 0, h);
        const double f2 = again ? -2.0 : integral(&force, 0, h);
        fmu_assert_motion(c, tau1, f2, 1e-10);
        // reading an input gives what was set last
        TEST_ASSERT_EQUAL_DOUBLE(again ? 1.0 : torque.d[0], fmu_get(c, RP_MANIPULATOR_tau1));
        TEST_ASSERT_EQUAL_DOUBLE(again ? -2.0 : force.d[0], fmu_get(c, RP_MANIPULATOR_f2));
        fmu_set(c, RP_MANIPULATOR_tau1, 1.0);
        fmu_set(c, RP_MANIPULATOR_f2, -2.0);
    }
}

/* The same value set again is a set: the polynomial is over. */
static void test_setting_the_value_again_ends_the_polynomial(void) {
    const fmi2Component c = sliding(0.0);
    set_polynomial(c, RP_MANIPULATOR_f2, &forces[ALL]);
    step(c, 0.0, 0.5);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, integral(&forces[ALL], 0, 0.5) / slide_mass,
                              fmu_get(c, RP_MANIPULATOR_ddq2));
    fmu_set(c, RP_MANIPULATOR_f2, forces[ALL].d[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, forces[ALL].d[0] / slide_mass,
                              fmu_get(c, RP_MANIPULATOR_ddq2));
}

/* ---- Derivatives of outputs ------------------------------------------------------------------ */

static double output_derivative(fmi2Component c, fmi2ValueReference reference, fmi2Integer order) {
    double value = NAN;
    ASSERT_OK(fmu.GetRealOutputDerivatives(c, &reference, 1, &order, &value));
    return value;
}

/* The whole arm, whose inputs move: against differences of order 8 of the outputs at steps that end
 * a little earlier or later. Asking changes nothing. */
static void test_output_derivatives_are_those_of_differences(void) {
    static const fmi2ValueReference outputs[] = {
        RP_MANIPULATOR_q1,           RP_MANIPULATOR_dq2,           RP_MANIPULATOR_ddq1,
        RP_MANIPULATOR_ddq2,         RP_MANIPULATOR_ee_x,          RP_MANIPULATOR_ee_y,
        RP_MANIPULATOR_total_energy, RP_MANIPULATOR_actuator_power};
    static const double firsts[] = {0.0, 4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0};
    static const double seconds[] = {-205.0 / 72.0, 8.0 / 5.0, -1.0 / 5.0, 8.0 / 315.0,
                                     -1.0 / 560.0};
    const double end = 0.125, h = 1.0 / 512.0;
    double first[FMU_COUNT(outputs)] = {0}, second[FMU_COUNT(outputs)] = {0};
    for (int k = -4; k <= 4; k++) {
        const fmi2Component c = swinging();
        step(c, 0.0, end + k * h);
        for (size_t i = 0; i < FMU_COUNT(outputs); i++) {
            const double value = fmu_get(c, outputs[i]);
            first[i] += (k < 0 ? -1.0 : 1.0) * firsts[abs(k)] * value / h;
            second[i] += seconds[abs(k)] * value / (h * h);
        }
        fmu_free(c);
    }
    struct fmu_values before, after;
    const fmi2Component c = swinging();
    step(c, 0.0, end);
    ASSERT_OK(fmu_get_all(c, &before));
    for (size_t i = 0; i < FMU_COUNT(outputs); i++) {
        const double scale = 1.0 + fabs(fmu_get(c, outputs[i]));
        TEST_ASSERT_DOUBLE_WITHIN(1e-11 * scale / h, first[i], output_derivative(c, outputs[i], 1));
        TEST_ASSERT_DOUBLE_WITHIN(1e-11 * scale / (h * h), second[i],
                                  output_derivative(c, outputs[i], 2));
    }
    ASSERT_OK(fmu_get_all(c, &after));
    fmu_assert_same_values(&before, &after, "after derivatives of outputs");
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

static void test_output_derivatives_that_are_refused(void) {
    static const struct {
        fmi2ValueReference reference;
        fmi2Integer order;
        const char *word; /* of the message */
    } cases[] = {
        {RP_MANIPULATOR_q1, 0, "0"},
        {RP_MANIPULATOR_q1, 3, "3"},
        {RP_MANIPULATOR_q1, -1, "-1"},
        {RP_MANIPULATOR_q1, INT_MIN, "order"},
        {9999, 1, "9999"},
        {RP_MANIPULATOR_f2, 1, "f2"},
        {RP_MANIPULATOR_m1, 1, "m1"},
        {RP_MANIPULATOR_solver_steps, 1, "solver_steps"},
        {RP_MANIPULATOR_time, 1, "time"},
    };
    for (size_t i = 0; i < FMU_COUNT(cases); i++) {
        const fmi2Component c = fmu_initialized(&messages, 0.0);
        const fmi2ValueReference references[] = {RP_MANIPULATOR_q2, cases[i].reference};
        const fmi2Integer orders[] = {1, cases[i].order};
        double values[] = {-12345.678, -12345.678};
        fmu_log_clear(&messages);
        TEST_ASSERT_EQUAL_INT_MESSAGE(
            fmi2Error, fmu.GetRealOutputDerivatives(c, references, 2, orders, values),
            cases[i].word);
        TEST_ASSERT_EQUAL_DOUBLE(-12345.678, values[0]);
        TEST_ASSERT_EQUAL_DOUBLE(-12345.678, values[1]);
        TEST_ASSERT_EQUAL_UINT(1, messages.count[fmi2Error]);
        fmu_assert_logged(&messages, cases[i].word);
        fmu_assert_in_error(c);
        fmu_assert_reset_is_fresh(c, cases[i].word);
        fmu_free(c);
    }
}
