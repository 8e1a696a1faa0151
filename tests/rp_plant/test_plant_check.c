/* Refusals when initialization ends, with the values in one line; ranges: fmu/test_ranges.py. */
#include "model_test.h"
#include "plant_test_support.h"
#include "unity.h"

static struct rp_plant_values v;

void setUp(void) {
    plant_test_start(&v);
    v.parameters.stops[1] = RP_PLANT_STOPS_RIGID;
    v.parameters.lower[1] = -1.0;
    v.parameters.upper[1] = 2.0;
}

static void assert_accepted(void) {
    model_test_accepted(&rp_plant_model, &v);
}

static void assert_refused(const char *expected) {
    model_test_refused(&rp_plant_model, &v, expected);
}

static void test_start_values_are_accepted(void) {
    assert_accepted();
    plant_test_start(&v);
    assert_accepted();
}

static void test_parameters_of_the_arm(void) {
    v.parameters.arm.m1 = v.parameters.arm.I1z = v.parameters.arm.I2z = 0.0;
    assert_refused("the inertia m1 lc1^2 + I1z + I2z = 0 is refused: it must be above 0 "
                   "(m1 = 0, lc1 = 0.25, I1z = 0, I2z = 0)");
}

static void test_breakaway_below_coulomb(void) {
    v.parameters.coulomb_friction[0] = 2.0;
    assert_accepted();
    v.parameters.breakaway_friction[0] = 2.0;
    assert_accepted();
    v.parameters.breakaway_friction[0] = 1.5;
    v.parameters.stribeck_velocity[0] = 1.0;
    assert_refused("breakaway_friction1 = 1.5 is refused: it must not be below "
                   "coulomb_friction1 = 2 (0: the same)");
}

static void test_breakaway_above_coulomb_needs_a_stribeck_velocity(void) {
    v.parameters.breakaway_friction[1] = 2.5;
    v.parameters.coulomb_friction[1] = 2.0;
    assert_refused("stribeck_velocity2 = 0 is refused: it must be above 0 where "
                   "breakaway_friction2 = 2.5 is above coulomb_friction2 = 2");
    v.parameters.stribeck_velocity[1] = 0.1;
    assert_accepted();
}

static void test_limits(void) {
    v.parameters.lower[1] = 2.0;
    assert_refused("lower2 = 2 and upper2 = 2 are refused: with stops lower2 must be below "
                   "upper2");
    v.parameters.stops[1] = RP_PLANT_STOPS_NONE;
    assert_accepted();
}

static void test_compliant_stops(void) {
    v.parameters.stop_damping[1] = 0.5;
    v.parameters.stops[1] = RP_PLANT_STOPS_COMPLIANT;
    assert_refused("stop_stiffness2 = 0 is refused: with compliant stops it must be "
                   "above 0");
    v.parameters.stop_stiffness[1] = 1e4;
    assert_accepted();
    v.q[1] = 2.5; // a start in a stop
    assert_accepted();
    v.parameters.lower[1] = 3.0;
    assert_refused("lower2 = 3 and upper2 = 2 are refused: with stops lower2 must be below "
                   "upper2");
}

static void test_start_outside_the_stops(void) {
    v.q[1] = 2.5;
    assert_refused("q2 = 2.5 is refused: a start must be within lower2 = -1 and upper2 = 2");
    v.q[1] = -1.5;
    assert_refused("q2 = -1.5 is refused: a start must be within lower2 = -1 and upper2 = 2");
    v.q[1] = 2.0;
    assert_accepted();
    v.q[1] = -1.0;
    assert_accepted();
}

/* While it runs a limit may pass the joint: test_plant_stops.c. */
static void test_limit_past_a_joint_that_runs(void) {
    plant_test_update(&v, -1);
    v.q[1] = 2.5;
    assert_accepted();
}
