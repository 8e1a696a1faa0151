/* What is refused when initialization ends, with the values in one line. */
#include "model_test.h"
#include "plant_test_support.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>

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

static void test_negative_values(void) {
    struct {
        double *value;
        const char *name;
    } all[] = {
        {&v.parameters.armature[0], "armature1"},
        {&v.parameters.armature[1], "armature2"},
        {&v.parameters.damping[0], "damping1"},
        {&v.parameters.damping[1], "damping2"},
        {&v.parameters.coulomb_friction[0], "coulomb_friction1"},
        {&v.parameters.coulomb_friction[1], "coulomb_friction2"},
        {&v.parameters.breakaway_friction[0], "breakaway_friction1"},
        {&v.parameters.breakaway_friction[1], "breakaway_friction2"},
        {&v.parameters.stribeck_velocity[0], "stribeck_velocity1"},
        {&v.parameters.stribeck_velocity[1], "stribeck_velocity2"},
        {&v.parameters.payload_mass, "payload_mass"},
        {&v.parameters.payload_inertia, "payload_inertia"},
        {&v.parameters.stop_stiffness[1], "stop_stiffness2"},
        {&v.parameters.stop_damping[1], "stop_damping2"},
    };
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++) {
        const double refused[] = {-0.5, NAN, INFINITY};
        for (size_t k = 0; k < 3; k++) {
            char expected[128];
            *all[i].value = refused[k];
            (void)snprintf(expected, sizeof expected,
                           "%s = %g is refused: it must be finite and not below 0", all[i].name,
                           refused[k]);
            assert_refused(expected);
        }
        *all[i].value = 0.0;
        assert_accepted();
    }
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
    assert_refused("lower2 = 2 and upper2 = 2 are refused: with stops they must be finite and "
                   "lower2 below upper2");
    v.parameters.stops[1] = RP_PLANT_STOPS_NONE;
    assert_accepted();
    v.parameters.stops[1] = RP_PLANT_STOPS_RIGID;
    v.parameters.lower[1] = -INFINITY;
    assert_refused("lower2 = -inf and upper2 = 2 are refused: with stops they must be finite and "
                   "lower2 below upper2");
}

static void test_compliant_stops(void) {
    v.parameters.stop_damping[1] = 0.5;
    v.parameters.stops[1] = RP_PLANT_STOPS_COMPLIANT;
    assert_refused("stop_stiffness2 = 0 is refused: with compliant stops it must be finite and "
                   "above 0");
    v.parameters.stop_stiffness[1] = 1e4;
    assert_accepted();
    v.q[1] = 2.5; // a start in a stop
    assert_accepted();
    v.parameters.lower[1] = 3.0;
    assert_refused("lower2 = 3 and upper2 = 2 are refused: with stops they must be finite and "
                   "lower2 below upper2");
}

static void test_ranges(void) {
    struct rp_plant_parameters *p = &v.parameters;
    const struct {
        double *value;
        double refused;
        const char *text;
    } cases[] = {
        {&p->restitution[0], 1.25, "restitution1 = 1.25 is refused: it must be within 0 and 1"},
        {&p->restitution[0], -0.25, "restitution1 = -0.25 is refused: it must be within 0 and 1"},
        {&p->restitution[1], NAN, "restitution2 = nan is refused: it must be within 0 and 1"},
        {&p->payload_x, NAN,
         "payload_x = nan and payload_z = 0.5 are refused: they must be finite"},
        {&p->payload_z, INFINITY,
         "payload_x = -0.5 and payload_z = inf are refused: they must be finite"},
    };
    p->restitution[0] = 1.0;
    p->payload_x = -0.5;
    p->payload_z = 0.5;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const double before = *cases[i].value;
        assert_accepted();
        *cases[i].value = cases[i].refused;
        assert_refused(cases[i].text);
        *cases[i].value = before;
    }
}

static void test_items_of_the_enumerations(void) {
    v.parameters.stops[0] = 4;
    assert_refused("stops1 = 4 is refused: it must be within 1 and 3");
    v.parameters.stops[0] = 0;
    assert_refused("stops1 = 0 is refused: it must be within 1 and 3");
    v.parameters.stops[0] = RP_PLANT_STOPS_NONE;
    v.parameters.grasp = 0;
    assert_refused("grasp = 0 is refused: it must be 1 or 2");
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
