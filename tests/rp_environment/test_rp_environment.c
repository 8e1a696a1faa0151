/* The wall at its surface, and motions that overflow. test_environment.py compares force and moment
 * with sympy. */
#include "equations.h"
#include "last_text.h"

#include <math.h>
#include <unity.h>

static const struct model *const model = &equations_model;
static struct equations_values v;

void setUp(void) {
    v = (struct equations_values){
        .v_stiffness = 2000.0,
        .v_damping = 30.0,
        .v_position = -0.25,
        .v_tip_z = 0.125,
    };
}

static void outputs(void) {
    ASSERT_OK(model->outputs(&v, 0.0));
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
