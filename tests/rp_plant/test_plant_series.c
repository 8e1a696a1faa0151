/* Friction over a step. test_plant_series.py has all orders of the series, test_plant_model.py the
 * first ones in all modes. */
#include "last_text.h"
#include "plant_test_support.h"
#include "rp_plant_equations.h"
#include "unity.h"

#include <float.h>
#include <math.h>
#include <string.h>

enum { MAX_ROWS = 128 };

typedef double row[SERIES_LENGTH];

static struct rp_plant_values plant;
static double time_scale;
static double inputs[PLANT_INPUTS][SERIES_INPUT_LENGTH];
static row rows[MAX_ROWS];

static void expand(int last, row all[MAX_ROWS]) {
    const struct series_origin origin = {
        .values = &plant,
        .time_scale = time_scale,
        .inputs = (const double(*)[SERIES_INPUT_LENGTH])inputs,
    };
    TEST_ASSERT_LESS_OR_EQUAL_size_t(MAX_ROWS, rp_plant_model.series->row_count);
    memset(all, 0xff, sizeof(row) * MAX_ROWS); // NaN: what is read has been written
    for (int i = 0; i < 2; i++) {
        all[i][0] = plant.q[i];
        all[2 + i][0] = plant.dq[i];
    }
    ASSERT_OK(rp_plant_model.series->extend(&origin, 0, last, all));
}

static void assert_reach(double expected, double dq2) {
    double reach[PLANT_STATES];
    const double x[PLANT_STATES] = {1.0, 2.0, 3.0, dq2};
    rp_plant_model.events->reach(&plant, x, reach);
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_TRUE(reach[i] == INFINITY);
    }
    TEST_ASSERT_TRUE(reach[3] == INFINITY ? expected == INFINITY
                                          : fabs(reach[3] - expected) < 1e-14);
}

/* Where friction depends on the velocity, it changes by vs at most, but 6 vs from rest. */
static void test_reach_of_a_velocity(void) {
    plant_test_start(&plant);
    plant.modes =
        (struct rp_plant_modes){{RP_PLANT_FORWARD, RP_PLANT_FORWARD}, RP_PLANT_RELEASED, {0, 0}};
    plant.parameters.coulomb_friction[1] = 1.0;
    plant.parameters.stribeck_velocity[1] = 0.25;
    assert_reach(INFINITY, 0.5);
    plant.parameters.breakaway_friction[1] = 2.0;
    assert_reach(0.25, 0.0);
    assert_reach(0.25, 1.5);
    assert_reach(0.5, 2.0);
    assert_reach(8.5, -10.0);
    plant.modes.joint[1] = RP_PLANT_BACKWARD;
    assert_reach(0.25, -0.5);
    plant.modes.joint[1] = RP_PLANT_STUCK;
    assert_reach(INFINITY, 0.0);
}

/* An internal step continues past the velocity 0, where an event ends the mode: friction is smooth
 * there, but does not fall to what it was before, which the step would take for no change. */
static void test_friction_of_a_mode_that_is_over_stays_high(void) {
    struct rp_plant_parameters *p = &plant.parameters;
    plant_test_start(&plant);
    p->coulomb_friction[0] = 0.5;
    p->breakaway_friction[0] = 2.0;
    p->stribeck_velocity[0] = 0.25;
    for (int n = 1; n <= 1000; n++) {
        const double dq = 0.25 * 8.0 * n / 1000.0;
        const double before = plant_sliding_friction(p, 0, dq);
        const double after = plant_sliding_friction(p, 0, -dq);
        const double w = dq / 0.25;
        ASSERT_CLOSE(before + 1.5 / (1.0 + pow(w, -8.0)), after, 8 * DBL_EPSILON * 2.0);
        TEST_ASSERT_TRUE(after > 1.1);
    }
    for (double speed = 1e6; speed < 1e301; speed *= 1e294) {
        TEST_ASSERT_TRUE(plant_sliding_friction(p, 0, speed) == 0.5);
        TEST_ASSERT_TRUE(plant_sliding_friction(p, 0, -speed) == 2.0);
    }
}

/* Where nothing of it is left, friction is constant over a step: no coefficient has any. */
static void test_friction_of_a_fast_joint_is_constant(void) {
    static row constant[MAX_ROWS];
    plant_test_start(&plant);
    plant.modes =
        (struct rp_plant_modes){{RP_PLANT_STUCK, RP_PLANT_FORWARD}, RP_PLANT_RELEASED, {0, 0}};
    plant.parameters.coulomb_friction[0] = 100.0;
    plant.parameters.coulomb_friction[1] = 1.0;
    plant.parameters.stribeck_velocity[1] = 0.25;
    plant.q[0] = 1.0;
    time_scale = 0.001;
    memset(inputs, 0, sizeof inputs);
    for (int n = 0; n < 2; n++) {
        plant.dq[1] = n == 0 ? 2.0 : 1.5; // 8 vs, 6 vs
        plant.parameters.breakaway_friction[1] = 1.0;
        expand(8, constant);
        plant.parameters.breakaway_friction[1] = 1000.0;
        expand(8, rows);
        const bool same = memcmp(constant[3], rows[3], 9 * sizeof(double)) == 0;
        TEST_ASSERT_TRUE(same == (n == 0));
    }
}
