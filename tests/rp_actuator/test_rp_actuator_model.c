/* The drives as the instance sees them: the derivatives of their fields along curves, the
 * integrator's view with the Jacobian, what is refused. */
#include "last_text.h"
#include "model_test.h"
#include "rp_actuator_equations.h"
#include "rp_actuator_model.h"
#include "rp_test_support.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

/* All that a curve moves, then the calculated fields. */
enum {
    CALCULATED = offsetof(struct rp_actuator_values, dcurrent) / sizeof(double),
    DOUBLES = sizeof(struct rp_actuator_values) / sizeof(double),
};

union point {
    struct rp_actuator_values v;
    double all[DOUBLES];
};

/* What decides the current: the command, or a limit on either side. */
enum { FREE, CURRENT_HIGH, CURRENT_LOW, VOLTAGE_HIGH, VOLTAGE_LOW, BOTH, SIDES };

static union point at, first, second;
static struct rp_test_random random_source;

void setUp(void) {
    random_source.state = 61;
}

/* Far from the other sides, at which the result has a kink. */
static void next_point(int side) {
    memset(&at, 0, sizeof at);
    for (int i = 0; i < CALCULATED; i++) {
        at.all[i] = rp_test_uniform(&random_source, 0.5, 2.0);
        first.all[i] = rp_test_uniform(&random_source, -0.5, 0.5);
        second.all[i] = rp_test_uniform(&random_source, -0.5, 0.5);
    }
    struct rp_actuator_values *v = &at.v;
    for (int i = 0; i < 2; i++) {
        static const double commands[SIDES] = {1.0, 1e4, -1e4, 1e4, -1e4, 1.0};
        static const double speeds[SIDES] = {1.0, 1.0, 1.0, 1.0, 1.0, 1e5};
        const double large = 1e3;
        v->inputs.effort_cmd[i] *= commands[side];
        v->inputs.dq[i] *= speeds[side];
        v->parameters.current_max[i] *= side == VOLTAGE_HIGH || side == VOLTAGE_LOW ? large : 32.0;
        v->parameters.voltage_max[i] *= side == VOLTAGE_HIGH || side == VOLTAGE_LOW ? 16.0 : large;
    }
}

static double field_at(const void *field, double t) {
    union point moved = at;
    for (int i = 0; i < CALCULATED; i++) {
        moved.all[i] += t * first.all[i] + 0.5 * t * t * second.all[i];
    }
    ASSERT_OK(rp_actuator_model.outputs(&moved.v, t));
    return moved.all[*(const int *)field];
}

/* ---- Derivatives along curves --------------------------------------------------------------- */

static void test_points_lie_where_their_side_says(void) {
    for (int n = 0; n < 20 * SIDES; n++) {
        next_point(n % SIDES);
        struct rp_actuator_values *v = &at.v;
        const struct rp_actuator_parameters *p = &v->parameters;
        ASSERT_OK(rp_actuator_model.outputs(v, 0.0));
        for (int i = 0; i < 2; i++) {
            const double constant = p->gear_ratio[i] * p->torque_constant[i];
            const double voltage = p->resistance[i] * v->limited[i] + constant * v->inputs.dq[i];
            const double u_max = p->voltage_max[i], i_max = p->current_max[i];
            const double distance[SIDES] = {
                [FREE] = v->limited[i] - v->inputs.effort_cmd[i] / constant,
                [CURRENT_HIGH] = v->limited[i] - i_max,
                [CURRENT_LOW] = v->limited[i] + i_max,
                [VOLTAGE_HIGH] = voltage - u_max,
                [VOLTAGE_LOW] = voltage + u_max,
                [BOTH] = v->limited[i] + i_max,
            };
            ASSERT_CLOSE(0.0, distance[n % SIDES], 64 * DBL_EPSILON * u_max);
            TEST_ASSERT_TRUE(n % SIDES != BOTH || voltage > u_max);
        }
    }
}

static void test_derivatives_along_curves_are_those_of_the_fields(void) {
    const double h = 1.0 / 256;
    for (int n = 0; n < 20 * SIDES; n++) {
        next_point(n % SIDES);
        ASSERT_OK(rp_actuator_model.propagate(&at.v, 0.0, 1.0, &first.v, &second.v));
        for (int field = CALCULATED; field < DOUBLES; field++) {
            const double scale = 1.0 + fabs(field_at(&field, 0.0));
            ASSERT_CLOSE(rp_test_derivative(field_at, &field, 0.0, h), first.all[field],
                         1e-10 * scale);
            ASSERT_CLOSE(rp_test_second_derivative(field_at, &field, 0.0, h), second.all[field],
                         1e-8 * scale);
        }
    }
}

static void test_calculated_fields_are_written_and_not_read(void) {
    for (int n = 0; n < 20 * SIDES; n++) {
        next_point(n % SIDES);
        model_test_calculated_fields(&rp_actuator_model, &at, &first, &second,
                                     CALCULATED * sizeof(double));
    }
}

/* ---- For the integrator --------------------------------------------------------------------- */

static void test_what_is_integrated_are_the_rates_that_are_output(void) {
    for (int n = 0; n < 20 * SIDES; n++) {
        next_point(n % SIDES);
        union point parameters; // states and inputs are arguments
        memset(&parameters, 0xff, sizeof parameters);
        parameters.v.parameters = at.v.parameters;
        double dx[2];
        ASSERT_OK(rp_actuator_model.right_hand_side(&parameters.v, 0.0, at.v.current,
                                                    at.v.inputs.effort_cmd, dx));
        ASSERT_OK(rp_actuator_model.outputs(&at.v, 0.0));
        TEST_ASSERT_EQUAL_MEMORY(at.v.dcurrent, dx, sizeof dx);
    }
}

static void test_jacobian_is_what_propagation_gives(void) {
    for (int n = 0; n < 20 * SIDES; n++) {
        next_point(n % SIDES);
        double J[2][2];
        memset(J, 0xff, sizeof J);
        ASSERT_OK(
            rp_actuator_model.jacobian(&at.v, 0.0, at.v.current, at.v.inputs.effort_cmd, J[0]));
        for (int j = 0; j < 2; j++) {
            memset(&first, 0, sizeof first);
            first.v.current[j] = 1.0;
            ASSERT_OK(rp_actuator_model.propagate(&at.v, 0.0, 0.0, &first.v, NULL));
            TEST_ASSERT_TRUE(J[j][0] == first.v.dcurrent[0] && J[j][1] == first.v.dcurrent[1]);
        }
    }
}

/* ---- The limits ----------------------------------------------------------------------------- */

static void test_not_a_number_is_not_limited(void) {
    next_point(FREE);
    at.v.inputs.effort_cmd[0] = NAN;
    TEST_ASSERT_TRUE(isnan(drive_limited_current(&at.v.parameters, &at.v.inputs, 0)));
    TEST_ASSERT_FALSE(isnan(drive_limited_current(&at.v.parameters, &at.v.inputs, 1)));
}

/* A command or a back-EMF that overflows is only very large. */
static void test_what_overflows_meets_the_limit(void) {
    next_point(FREE);
    struct rp_actuator_parameters *p = &at.v.parameters;
    p->gear_ratio[0] = 1e-9;
    at.v.inputs.effort_cmd[0] = DBL_MAX;
    p->gear_ratio[1] = 1e9;
    at.v.inputs.dq[1] = DBL_MAX;
    TEST_ASSERT_TRUE(drive_limited_current(p, &at.v.inputs, 0) == p->current_max[0]);
    TEST_ASSERT_TRUE(drive_limited_current(p, &at.v.inputs, 1) == -p->current_max[1]);
}

/* ---- What is refused ------------------------------------------------------------------------ */

static void test_gears_without_a_ratio_are_refused(void) {
    next_point(FREE);
    double *ratio = at.v.parameters.gear_ratio;
    ratio[0] = -1e-9;
    ratio[1] = 1e-9;
    model_test_accepted(&rp_actuator_model, &at);
    const struct {
        double ratio;
        const char *text;
    } wrong[] = {{0.0, "0"}, {9e-10, "9e-10"}, {-5e-10, "-5e-10"}, {NAN, "nan"}};
    for (int i = 0; i < 8; i++) {
        char expected[128];
        ratio[0] = ratio[1] = 1.0;
        ratio[i / 4] = wrong[i % 4].ratio;
        (void)snprintf(expected, sizeof expected,
                       "gear_ratio%d = %s is refused: its magnitude must be 1e-09 or more",
                       i / 4 + 1, wrong[i % 4].text);
        model_test_refused(&rp_actuator_model, &at, expected);
    }
}
