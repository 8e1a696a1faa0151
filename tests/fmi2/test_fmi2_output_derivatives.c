/* Derivatives of outputs with respect to time after a step with inputs that are polynomials.
 * FMI 2.0, section 4.2.1. */
#include "fmu_polynomials.h"

#include <limits.h>
#include <math.h>
#include <unity.h>

static void step(fmi2Component c, double time, double length) {
    ASSERT_OK(fmu.DoStep(c, time, length, fmi2True));
}

static double output_derivative(fmi2Component c, fmi2ValueReference reference, fmi2Integer order) {
    double value = NAN;
    ASSERT_OK(fmu.GetRealOutputDerivatives(c, &reference, 1, &order, &value));
    return value;
}

static void test_output_derivatives_of_the_slide(void) {
    const double s = 0.5;
    for (size_t i = 0; i < FMU_SLIDE_FORCES; i++) {
        const struct fmu_polynomial *p = &fmu_slide_forces[i];
        const fmi2Component c = fmu_slide(&messages, 0.0);
        fmu_slide_begin(c);
        fmu_set_polynomial(c, RP_MANIPULATOR_f2, p);
        step(c, 0.0, s);
        const double dq2 = fmu_get(c, RP_MANIPULATOR_dq2);
        const double f = fmu_polynomial_integral(p, 0, s);
        const double f_dot = fmu_polynomial_integral(p, -1, s);
        const double f_dot_dot = fmu_polynomial_integral(p, -2, s);
        const struct {
            fmi2ValueReference reference;
            double first, second;
        } expected[] = {
            {RP_MANIPULATOR_q1, 0.0, 0.0},
            {RP_MANIPULATOR_q2, dq2, f / fmu_slide_mass},
            {RP_MANIPULATOR_dq2, f / fmu_slide_mass, f_dot / fmu_slide_mass},
            {RP_MANIPULATOR_ddq2, f_dot / fmu_slide_mass, f_dot_dot / fmu_slide_mass},
            {RP_MANIPULATOR_kinetic_energy, f * dq2, f_dot * dq2 + f * f / fmu_slide_mass},
            {RP_MANIPULATOR_potential_energy, 0.0, 0.0},
            {RP_MANIPULATOR_actuator_power, f_dot * dq2 + f * f / fmu_slide_mass,
             f_dot_dot * dq2 + 3.0 * f_dot * f / fmu_slide_mass},
        };
        for (size_t j = 0; j < FMU_COUNT(expected); j++) {
            TEST_ASSERT_DOUBLE_WITHIN(1e-10, expected[j].first,
                                      output_derivative(c, expected[j].reference, 1));
            TEST_ASSERT_DOUBLE_WITHIN(1e-10, expected[j].second,
                                      output_derivative(c, expected[j].reference, 2));
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
