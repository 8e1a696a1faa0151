/* The smooth part: friction law, rates of the reactions. fmu/test_plant_fmu.py compares motion,
 * energies and joint loads with the Lagrangian. */
#include "last_text.h"
#include "plant_test_support.h"
#include "rp_plant_equations.h"
#include "rp_plant_modes.h"
#include "unity.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define EPS DBL_EPSILON

static struct rp_test_random random_source;
static struct rp_plant_values v;

void setUp(void) {
    random_source.state = 53;
}

static void next_sample(void) {
    plant_test_random_plant(&random_source, &v);
    for (int i = 0; i < 2; i++) {
        if (v.modes.joint[i] == RP_PLANT_STUCK) {
            v.dq[i] = 0.0;
        }
    }
}

/* Every second one in compliant stops. */
static void next_sample_at_stops(int n) {
    next_sample();
    if (n % 2 == 0) {
        plant_test_random_contacts(&random_source, &v);
    }
}

/* ---- Friction ------------------------------------------------------------------------------- */

static void test_friction_falls_from_breakaway_to_coulomb(void) {
    struct rp_plant_parameters *p = &v.parameters;
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        plant_test_start(&v);
        p->coulomb_friction[1] = rp_test_uniform(&random_source, 0.0, 1.0) / 3.0;
        p->breakaway_friction[1] = p->coulomb_friction[1] + rp_test_uniform(&random_source, 0.1, 1);
        p->stribeck_velocity[1] = rp_test_uniform(&random_source, 0.1, 2.0);
        const double fc = p->coulomb_friction[1];
        const double fb = p->breakaway_friction[1];
        const double vs = p->stribeck_velocity[1];
        TEST_ASSERT_TRUE(plant_breakaway(p, 1) == fb);
        TEST_ASSERT_TRUE(plant_sliding_friction(p, 1, 0.0) == fb);
        TEST_ASSERT_TRUE(plant_sliding_friction(p, 1, 1e6) == fc);
        TEST_ASSERT_TRUE(plant_sliding_friction(p, 1, 1e300) == fc);
        const double dq = rp_test_uniform(&random_source, 0.0, 4.0);
        const double expected = fc + (fb - fc) * exp(-(dq / vs) * (dq / vs));
        ASSERT_CLOSE(expected, plant_sliding_friction(p, 1, dq), 8 * EPS * fb);
    }
}

/* An internal step continues past the velocity 0, where an event ends the mode: friction is smooth
 * there, but does not fall to what it was before, which the step would take for no change. */
static void test_friction_of_a_mode_that_is_over_stays_high(void) {
    struct rp_plant_parameters *p = &v.parameters;
    plant_test_start(&v);
    p->coulomb_friction[0] = 0.5;
    p->breakaway_friction[0] = 2.0;
    p->stribeck_velocity[0] = 0.25;
    for (int n = 1; n <= 1000; n++) {
        const double dq = 0.25 * 8.0 * n / 1000.0;
        const double before = plant_sliding_friction(p, 0, dq);
        const double after = plant_sliding_friction(p, 0, -dq);
        const double w = dq / 0.25;
        ASSERT_CLOSE(before + 1.5 / (1.0 + pow(w, -8.0)), after, 8 * EPS * 2.0);
        TEST_ASSERT_TRUE(after > 1.1);
    }
    TEST_ASSERT_TRUE(plant_sliding_friction(p, 0, -1e6) == 2.0);
    TEST_ASSERT_TRUE(plant_sliding_friction(p, 0, -1e300) == 2.0);
}

static void test_without_breakaway_friction_is_coulombs(void) {
    plant_test_start(&v);
    v.parameters.coulomb_friction[0] = 0.3;
    v.parameters.stribeck_velocity[0] = 1.0;
    TEST_ASSERT_TRUE(plant_breakaway(&v.parameters, 0) == 0.3);
    TEST_ASSERT_TRUE(plant_sliding_friction(&v.parameters, 0, 0.5) == 0.3);
    v.parameters.breakaway_friction[0] = 0.3;
    v.parameters.stribeck_velocity[0] = 0.0;
    TEST_ASSERT_TRUE(plant_sliding_friction(&v.parameters, 0, 0.5) == 0.3);
    TEST_ASSERT_TRUE(plant_sliding_friction(&v.parameters, 0, 0.0) == 0.3);
}

/* With the mode frozen the friction keeps its sign where the velocity passes 0. */
static void test_sliding_friction_is_smooth_past_zero(void) {
    struct rp_plant_motion motion[2];
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        next_sample();
        v.modes.joint[0] = RP_PLANT_FORWARD;
        v.modes.joint[1] = RP_PLANT_BACKWARD;
        for (int k = 0; k < 2; k++) {
            const double dq[2] = {k == 0 ? 1e-13 : -1e-13, k == 0 ? -1e-13 : 1e-13};
            rp_plant_motion(&v.parameters, &v.modes, v.q, dq, &v.inputs, &motion[k]);
        }
        for (int i = 0; i < 2; i++) {
            ASSERT_CLOSE(motion[0].ddq[i], motion[1].ddq[i], 1e-9 * (1 + fabs(motion[0].ddq[i])));
        }
    }
}

/* ---- Derivatives ---------------------------------------------------------------------------- */

static void test_rates_of_the_reactions(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        struct rp_plant_values first;
        struct rp_plant_inputs du;
        double rates[2];
        next_sample_at_stops(n);
        plant_test_outputs(&v);
        memset(&first, 0, sizeof first);
        memcpy(first.q, v.dq, sizeof v.dq);
        memcpy(first.dq, v.ddq, sizeof v.ddq);
        for (int i = 0; i < 2; i++) {
            du.tau[i] = rp_test_uniform(&random_source, -5.0, 5.0);
        }
        for (int i = 0; i < 3; i++) {
            du.wrench[i] = rp_test_uniform(&random_source, -5.0, 5.0);
        }
        first.inputs = du;
        ASSERT_OK(rp_plant_model.propagate(&v, 3.0, 0.0, &first, NULL));
        struct rp_plant_modes modes;
        rp_plant_modes_in_effect(&v, v.q, v.dq, &v.inputs, &modes);
        rp_plant_reaction_rates(&v.parameters, &modes, v.q, v.dq, &v.inputs, &du, rates);
        for (int i = 0; i < 2; i++) {
            const bool stuck = modes.joint[i] == RP_PLANT_STUCK;
            ASSERT_SAME(stuck ? first.friction[i] : 0.0, rates[i]);
        }
    }
}
