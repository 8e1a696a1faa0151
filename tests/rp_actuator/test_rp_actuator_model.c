/* The drives at the ends of the numbers, and what is refused. */
#include "last_text.h"
#include "model_test.h"
#include "rp_actuator_equations.h"
#include "rp_actuator_model.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <unity.h>

static struct rp_actuator_values at;

void setUp(void) {
    at = (struct rp_actuator_values){
        .parameters = {{1.0, 1.5}, {0.5, 1.5}, {1.0, 2.0}, {32.0, 48.0}, {1e3, 2e3}, {1.0, 0.5}},
        .inputs = {{1.5, 0.5}, {1.0, 2.0}},
    };
}

/* ---- The limits ----------------------------------------------------------------------------- */

static void test_not_a_number_is_not_limited(void) {
    at.inputs.effort_cmd[0] = NAN;
    TEST_ASSERT_TRUE(isnan(drive_limited_current(&at.parameters, &at.inputs, 0)));
    TEST_ASSERT_FALSE(isnan(drive_limited_current(&at.parameters, &at.inputs, 1)));
}

/* A command or a back-EMF that overflows is only very large. */
static void test_what_overflows_meets_the_limit(void) {
    struct rp_actuator_parameters *p = &at.parameters;
    p->gear_ratio[0] = 1e-9;
    at.inputs.effort_cmd[0] = DBL_MAX;
    p->gear_ratio[1] = 1e9;
    at.inputs.dq[1] = DBL_MAX;
    TEST_ASSERT_TRUE(drive_limited_current(p, &at.inputs, 0) == p->current_max[0]);
    TEST_ASSERT_TRUE(drive_limited_current(p, &at.inputs, 1) == -p->current_max[1]);
}

/* ---- What is refused ------------------------------------------------------------------------ */

static void test_gears_without_a_ratio_are_refused(void) {
    double *ratio = at.parameters.gear_ratio;
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
