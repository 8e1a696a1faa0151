/* The wall: where it touches and lets go. test_environment.py compares force and moment with sympy.
 */
#include "equations.h"
#include "last_text.h"
#include "model_test.h"
#include "rp_test_support.h"

#include <math.h>
#include <string.h>
#include <unity.h>

static const struct model *const model = &equations_model;
static struct equations_values v;
static struct rp_test_random random_source;

void setUp(void) {
    random_source.state = 11;
    v = (struct equations_values){
        .v_stiffness = 2000.0,
        .v_damping = 30.0,
        .v_position = -0.25,
        .v_tip_z = 0.125,
    };
}
static double uniform(double low, double high) {
    return rp_test_uniform(&random_source, low, high);
}

static void outputs(void) {
    ASSERT_OK(model->outputs(&v, 0.0));
}

/* A random wall, and a tip at the depth given, which moves at random. */
static void next_at_depth(double depth) {
    v.v_stiffness = uniform(500.0, 2000.0);
    v.v_damping = uniform(1.0, 50.0);
    v.v_position = uniform(-0.5, 0.5);
    v.v_angle = uniform(-4.0, 4.0);
    v.v_tip_x = uniform(-0.25, 0.25);
    v.v_tip_z = uniform(-0.25, 0.25);
    v.v_ee_angle = uniform(-4.0, 4.0);
    v.v_ee_rate = uniform(-2.0, 2.0);
    const double along = uniform(-1.0, 1.0);
    const double normal = v.v_position - depth;
    const double c = cos(v.v_ee_angle);
    const double s = sin(v.v_ee_angle);
    const double n[2] = {cos(v.v_angle), sin(v.v_angle)};
    v.v_ee_x = normal * n[0] - along * n[1] - (v.v_tip_z * c - v.v_tip_x * s);
    v.v_ee_y = normal * n[1] + along * n[0] - (v.v_tip_z * s + v.v_tip_x * c);
    v.v_ee_vx = uniform(-1.0, 1.0);
    v.v_ee_vy = uniform(-1.0, 1.0);
}

/* ---- The force ------------------------------------------------------------------------------ */

/* Normal x0, slide along x0: one line of arithmetic, exact in doubles. */
static void test_a_tip_that_moves_along_the_normal(void) {
    v.v_ee_x = -0.5; // the tip: -0.375, by 0.125 in the wall
    v.v_ee_vx = -0.5;
    v.v_ee_vy = 8.0; // no friction along the wall
    outputs();
    TEST_ASSERT_TRUE(v.v_penetration == 0.125);
    TEST_ASSERT_TRUE(v.v_wall_force == 2000.0 * 0.125 + 30.0 * 0.5);
    TEST_ASSERT_TRUE(v.v_ee_fx == v.v_wall_force && v.v_ee_fy == 0.0 && v.v_ee_mz == 0.0);
}

/* The arm's slide upwards: x2 points to -x0, z2 to y0. */
static void test_a_tip_beside_the_end_effector_takes_part_in_its_turn(void) {
    v.v_tip_x = 0.25;
    v.v_ee_angle = RP_TEST_PI / 2.0;
    v.v_ee_rate = 2.0;
    v.v_ee_x = -0.125; // the tip: (-0.375, 0.125)
    outputs();
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0.125, v.v_penetration);
    // from the end effector (-0.25, 0.125): turned by 2 rad/s, vx = -0.25 into the wall
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 2000.0 * 0.125 + 30.0 * 0.25, v.v_wall_force);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.125 * v.v_wall_force, v.v_ee_mz);
}

/* ---- Touch and release ---------------------------------------------------------------------- */

static void test_nothing_acts_outside_of_the_wall(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        next_at_depth(-uniform(1e-5, 0.5));
        v.v_ee_vx *= 1e3;
        v.v_ee_vy *= 1e3;
        outputs();
        TEST_ASSERT_TRUE(v.v_penetration == 0.0 && v.v_wall_force == 0.0);
        TEST_ASSERT_TRUE(v.v_ee_fx == 0.0 && v.v_ee_fy == 0.0 && v.v_ee_mz == 0.0);
    }
}

/* A tip on the surface is outside; just below it the damping acts in full. */
static void test_contact_begins_below_the_surface(void) {
    v.v_ee_vx = -1.0;
    v.v_ee_x = -0.375; // the tip: -0.25
    outputs();
    TEST_ASSERT_TRUE(v.v_penetration == 0.0 && v.v_wall_force == 0.0);
    v.v_ee_x = nextafter(-0.375, -1.0);
    outputs();
    TEST_ASSERT_TRUE(v.v_penetration > 0.0 && v.v_penetration < 1e-15);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 30.0, v.v_wall_force);
}

/* On the way out the force ends where damping outweighs the spring, within the wall. */
static void test_the_wall_never_pulls(void) {
    const double limit = 2000.0 * 0.0625 / 30.0; // m/s, at a depth of 1/16 m
    v.v_ee_x = -0.4375;
    v.v_ee_vx = 0.999 * limit;
    outputs();
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.001 * 2000.0 * 0.0625, v.v_wall_force);
    v.v_ee_vx = 1.001 * limit;
    outputs();
    TEST_ASSERT_TRUE(v.v_penetration == 0.0625 && v.v_wall_force == 0.0 && v.v_ee_fx == 0.0);
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        next_at_depth(uniform(-0.05, 0.05));
        outputs();
        TEST_ASSERT_TRUE(v.v_wall_force >= 0.0 && v.v_penetration >= 0.0);
    }
}

static void test_a_wall_without_stiffness_and_damping_is_felt_by_nobody(void) {
    next_at_depth(0.25);
    v.v_stiffness = v.v_damping = 0.0;
    outputs();
    TEST_ASSERT_TRUE(v.v_penetration > 0.2 && v.v_wall_force == 0.0);
}

/* A motion that overflows is not taken for one outside of the wall. */
static void test_what_is_no_number_stays_so(void) {
    v.v_ee_x = NAN;
    outputs();
    TEST_ASSERT_TRUE(isnan(v.v_penetration) && isnan(v.v_wall_force) && isnan(v.v_ee_fx));
    v.v_ee_x = -1.0;
    v.v_ee_vx = NAN;
    outputs();
    TEST_ASSERT_TRUE(v.v_penetration > 0.0 && isnan(v.v_wall_force));
}

static void test_there_is_no_state(void) {
    TEST_ASSERT_EQUAL_UINT64(0, model->states.size);
    ASSERT_OK(model->right_hand_side(&v, 0.0, NULL, NULL, NULL));
}
