/* Refusals when initialization ends, with the values in one line; ranges: fmu/test_ranges.py. */
#include "model_test.h"
#include "plant_test_support.h"
#include "unity.h"

static struct rp_plant_values v;
static struct rp_plant_parameters *const p = &v.parameters;

void setUp(void) {
    plant_test_start(&v);
    p->stops[1] = RP_PLANT_STOPS_RIGID;
    p->lower[1] = -1.0;
    p->upper[1] = 2.0;
}

static void assert_accepted(void) {
    model_test_accepted(&rp_plant_model, &v);
}

static void assert_refused(const char *expected) {
    model_test_refused(&rp_plant_model, &v, expected);
}

static void test_parameters_of_the_arm(void) {
    assert_accepted();
    p->arm.m1 = p->arm.I1z = p->arm.I2z = 0.0;
    assert_refused("the inertia m1 lc1^2 + I1z + I2z is refused: it must be above 0 "
                   "(m1 = 0, lc1 = 0.25, I1z = 0, I2z = 0)");
}

static void test_friction(void) {
    p->coulomb_friction[0] = 2.0;
    assert_accepted();
    p->breakaway_friction[0] = 2.0;
    assert_accepted();
    p->breakaway_friction[0] = 1.5;
    p->stribeck_velocity[0] = 1.0;
    assert_refused("breakaway_friction1 = 1.5 is refused: it must not be below "
                   "coulomb_friction1 = 2 (0: the same)");
    p->breakaway_friction[0] = 0.0;
    p->breakaway_friction[1] = 2.5;
    p->coulomb_friction[1] = 2.0;
    assert_refused("stribeck_velocity2 = 0 is refused: it must be above 0 where "
                   "breakaway_friction2 = 2.5 is above coulomb_friction2 = 2");
    p->stribeck_velocity[1] = 0.1;
    assert_accepted();
}

static void test_limits(void) {
    p->lower[1] = 2.0;
    assert_refused("lower2 = 2 and upper2 = 2 are refused: with stops lower2 must be below "
                   "upper2");
    p->stops[1] = RP_PLANT_STOPS_NONE;
    assert_accepted();
    p->stops[1] = RP_PLANT_STOPS_COMPLIANT;
    assert_refused("stop_stiffness2 = 0 is refused: with compliant stops it must be "
                   "above 0");
    p->stop_stiffness[1] = 1e4;
    assert_refused("lower2 = 2 and upper2 = 2 are refused: with stops lower2 must be below "
                   "upper2");
    p->lower[1] = -1.0;
    assert_accepted();
}

/* In compliant stops it can begin anywhere; while it runs a limit may pass the joint. */
static void test_start_outside_the_stops(void) {
    for (double q = -1.5; q <= 2.5; q += 0.5) {
        v.q[1] = q;
        if (q >= -1.0 && q <= 2.0) {
            assert_accepted();
        } else {
            assert_refused(q > 0.0 ? "q2 = 2.5 is refused: a start must be within lower2 = -1 and "
                                     "upper2 = 2"
                                   : "q2 = -1.5 is refused: a start must be within lower2 = -1 and "
                                     "upper2 = 2");
        }
    }
    p->stops[1] = RP_PLANT_STOPS_COMPLIANT;
    p->stop_stiffness[1] = 1e4;
    assert_accepted();
    p->stops[1] = RP_PLANT_STOPS_RIGID;
    plant_test_update(&v, -1);
    v.q[1] = 2.5;
    assert_accepted();
}
