/* Rigid stops: impacts, their end, rest and lift-off, limits that move. test_plant_impact.c has the
 * law of impact. */
#include "plant_test_support.h"
#include "unity.h"

#include <math.h>

enum { LOWER2 = 6, FORWARD2 = 4, BACKWARD2 = 5 }; /* indicators of the slide */

static struct rp_plant_values v;

/* Without gravity and offset, friction 3 in both joints; the first event has been. */
void setUp(void) {
    plant_test_start(&v);
    v.parameters.arm.g = v.parameters.arm.a = 0.0;
    v.parameters.coulomb_friction[0] = v.parameters.coulomb_friction[1] = 3.0;
    plant_test_update(&v, -1);
}

static void set_stops(int joint, double lower, double upper, double restitution) {
    v.parameters.stops[joint] = RP_PLANT_STOPS_RIGID;
    v.parameters.lower[joint] = lower;
    v.parameters.upper[joint] = upper;
    v.parameters.restitution[joint] = restitution;
}

static void assert_modes(int joint1, int joint2) {
    TEST_ASSERT_EQUAL_INT(joint1, v.modes.joint[0]);
    TEST_ASSERT_EQUAL_INT(joint2, v.modes.joint[1]);
}

/* The slide falls on its lower stop, upright, without offset: q2'' = -g and a bounce of height h
 * has the velocity sqrt(2 g h). */
static void set_falling_slide(double restitution, double height) {
    plant_test_start(&v);
    v.parameters.arm.a = 0.0;
    v.parameters.coulomb_friction[0] = 1.0;
    v.q[0] = RP_TEST_PI / 2.0;
    set_stops(1, 0.25, 2.0, restitution);
    v.q[1] = 0.25;
    plant_test_update(&v, -1);
    v.q[1] = nextafter(0.25, 1.0);
    v.dq[1] = -sqrt(2.0 * v.parameters.arm.g * height);
    v.modes.joint[1] = RP_PLANT_FREE;
}

static void test_an_impact_reverses_the_velocity_and_puts_the_joint_on_its_stop(void) {
    set_falling_slide(0.75, 0.5);
    const double before = v.dq[1];
    plant_test_update(&v, LOWER2);
    assert_modes(RP_PLANT_STUCK, RP_PLANT_FREE);
    ASSERT_SAME(0.25, v.q[1]);
    ASSERT_SAME(-0.75 * before, v.dq[1]);
    const double m2 = v.parameters.arm.m2;
    const double g = v.parameters.arm.g;
    ASSERT_CLOSE(-1.75 * m2 * before, v.sums.stop_impulse[1], 1e-15 * fabs(before) * 4);
    ASSERT_CLOSE((1.0 - 0.75 * 0.75) * m2 * g * 0.5, v.sums.impact_loss, 1e-14);
    ASSERT_SAME(0.0, v.sums.stop_impulse[0]);
}

static void test_bouncing_ends_where_a_bounce_is_below_the_tolerance(void) {
    // absolute tolerance 1e-10 (plant_test_update), heights after the impact
    for (int below = 0; below < 2; below++) {
        const double e = 0.5;
        set_falling_slide(e, (below ? 0.99e-10 : 1.01e-10) / (e * e));
        plant_test_update(&v, LOWER2);
        assert_modes(RP_PLANT_STUCK, below ? RP_PLANT_STUCK : RP_PLANT_FREE);
        TEST_ASSERT_TRUE(below ? v.dq[1] == 0.0 : v.dq[1] > 0.0);
    }
}

static void test_a_slide_on_its_stop_is_carried_until_it_is_lifted(void) {
    set_falling_slide(0.0, 0.5);
    plant_test_update(&v, LOWER2);
    assert_modes(RP_PLANT_STUCK, RP_PLANT_STUCK);
    plant_test_outputs(&v);
    const double weight = v.parameters.arm.m2 * v.parameters.arm.g;
    ASSERT_CLOSE(weight, v.stop_force[1], 1e-14 * weight);
    ASSERT_SAME(0.0, v.friction[1]);
    ASSERT_SAME(1.0, v.indicators[BACKWARD2]);
    ASSERT_CLOSE(weight, v.indicators[FORWARD2], 1e-14 * weight);

    v.inputs.tau[1] = weight;
    const double du[PLANT_INPUTS] = {0.0, 1.0};
    bool triggered[RP_PLANT_INDICATORS] = {false};
    triggered[FORWARD2] = true;
    plant_test_update_with(&v, triggered, du);
    assert_modes(RP_PLANT_STUCK, RP_PLANT_FREE);
    plant_test_outputs(&v);
    ASSERT_SAME(0.0, v.stop_force[1]);
    ASSERT_SAME(0.0, v.indicators[LOWER2]);
}

static void test_a_joint_on_its_stop_at_the_start(void) {
    // pressed on it, drawn off it, thrown at it
    const struct {
        double f2;
        double dq2;
        int mode2;
    } cases[] = {
        {-1.0, 0.0, RP_PLANT_STUCK}, {1.0, 0.0, RP_PLANT_FREE}, {0.0, -2.0, RP_PLANT_FREE}};
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        plant_test_start(&v);
        v.parameters.arm.g = 0.0;
        set_stops(1, 0.0, 1.0, 0.5);
        v.inputs.tau[1] = cases[n].f2;
        v.dq[1] = cases[n].dq2;
        plant_test_update(&v, -1);
        TEST_ASSERT_EQUAL_INT(cases[n].mode2, v.modes.joint[1]);
        TEST_ASSERT_TRUE(v.q[1] == 0.0 && v.dq[1] == -0.5 * cases[n].dq2);
    }
}

/* A limit that is moved past a joint takes it along; it strikes if the joint moves towards it. */
static void test_a_limit_that_passes_the_joint(void) {
    set_stops(1, -1.0, 1.0, 0.5);
    plant_test_update(&v, -1);
    v.parameters.upper[1] = -0.25;
    plant_test_update(&v, -1);
    assert_modes(RP_PLANT_STUCK, RP_PLANT_STUCK);
    TEST_ASSERT_TRUE(v.q[1] == -0.25 && v.dq[1] == 0.0);

    v.dq[1] = 2.0;
    v.parameters.upper[1] = -0.5;
    plant_test_update(&v, -1);
    TEST_ASSERT_TRUE(v.q[1] == -0.5 && v.dq[1] == -1.0);
    assert_modes(RP_PLANT_STUCK, RP_PLANT_BACKWARD);
}

/* An importer that handles events moves the stop that the slide has just reached. */
static void test_a_stop_that_is_moved_away_at_the_event_is_not_met(void) {
    set_falling_slide(0.5, 0.5);
    const double before = v.dq[1];
    const double q2 = v.q[1];
    v.parameters.lower[1] = -1.0;
    plant_test_update(&v, LOWER2);
    ASSERT_SAME(q2, v.q[1]);
    ASSERT_SAME(before, v.dq[1]);
    ASSERT_SAME(0.0, v.sums.impact_loss);
}

/* The same impact twice: twice the impulse and the loss, m2 v (1 + e) and m2 v^2 (1 - e^2) / 2. */
static void test_impulses_and_losses_add_up(void) {
    const double e = 0.5;
    set_falling_slide(e, 0.1);
    const struct rp_plant_values falling = v;
    const double speed = -v.dq[1];
    for (int count = 1; count <= 2; count++) {
        v.q[1] = falling.q[1];
        v.dq[1] = falling.dq[1];
        plant_test_update(&v, LOWER2);
        TEST_ASSERT_DOUBLE_WITHIN(1e-14, count * v.parameters.arm.m2 * speed * (1.0 + e),
                                  v.sums.stop_impulse[1]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-14,
                                  count * v.parameters.arm.m2 * speed * speed * (1.0 - e * e) / 2.0,
                                  v.sums.impact_loss);
    }
}

static void test_grazing_a_stop_changes_no_velocity(void) {
    set_stops(1, -1.0, 1.0, 0.5);
    v.q[1] = nextafter(-1.0, 0.0);
    v.dq[1] = 1e-3; // already on its way back
    v.modes.joint[1] = RP_PLANT_FORWARD;
    plant_test_update(&v, LOWER2);
    TEST_ASSERT_TRUE(v.q[1] == -1.0 && v.dq[1] == 1e-3);
    assert_modes(RP_PLANT_STUCK, RP_PLANT_FORWARD);
}

/* It would come back before its position had changed by a bit. The momentum of joint 1 is kept. */
static void test_a_joint_that_hardly_leaves_its_stop_stays(void) {
    set_stops(1, -1.0, 1.0, 0.5);
    v.parameters.arm.a = 0.3;
    v.q[1] = -1.0;
    v.dq[0] = 0.2;
    v.dq[1] = 1e-9;
    v.modes.joint[0] = v.modes.joint[1] = RP_PLANT_FORWARD;
    struct rp_plant_inertia inertia;
    rp_plant_inertia(&v.parameters, false, v.q[1], &inertia);
    const double before = rp_plant_kinetic_energy(&v.parameters, false, v.q, v.dq);
    const double p1 = inertia.D[0][0] * v.dq[0] + inertia.D[0][1] * v.dq[1];
    plant_test_update(&v, LOWER2);
    const double after = rp_plant_kinetic_energy(&v.parameters, false, v.q, v.dq);
    TEST_ASSERT_TRUE(v.q[1] == -1.0 && v.dq[1] == 0.0);
    assert_modes(RP_PLANT_FORWARD, RP_PLANT_STUCK);
    ASSERT_CLOSE(p1, inertia.D[0][0] * v.dq[0], 1e-15 * p1);
    ASSERT_CLOSE(before - after, v.sums.impact_loss, 1e-15 * before);
    TEST_ASSERT_TRUE(v.sums.impact_loss >= 0.0);
}

/* Both joints on stops: the impact of joint 1 drives the slide, which was leaving, back into its
 * stop. This repeats until both leave, and takes energy each time. */
static void test_impacts_in_turn_end_with_both_joints_leaving(void) {
    struct rp_test_random random = {67};
    int in_turn = 0;
    for (int n = 0; n < 20 * RP_TEST_SAMPLES; n++) {
        plant_test_random_plant(&random, &v);
        v.modes.payload = RP_PLANT_RELEASED;
        v.payload_attached = 0;
        int side[2];
        for (int i = 0; i < 2; i++) {
            const bool lower = rp_test_random_bits(&random) % 2 == 0;
            side[i] = lower ? 1 : -1;
            set_stops(i, lower ? v.q[i] : v.q[i] - 1.0, lower ? v.q[i] + 1.0 : v.q[i],
                      rp_test_uniform(&random, 0.0, 1.0));
        }
        const struct rp_plant_parameters *p = &v.parameters;
        const bool leaving = side[1] * v.dq[1] > 0.0 && side[0] * v.dq[0] < 0.0;
        const double before = rp_plant_kinetic_energy(p, false, v.q, v.dq);
        plant_test_update(&v, -1);
        const double after = rp_plant_kinetic_energy(p, false, v.q, v.dq);
        TEST_ASSERT_TRUE(side[0] * v.dq[0] >= 0.0 && side[1] * v.dq[1] >= 0.0);
        TEST_ASSERT_TRUE(v.sums.impact_loss >= 0.0);
        ASSERT_CLOSE(before - after, v.sums.impact_loss, 1e-12 * before);
        in_turn += leaving && v.sums.stop_impulse[1] != 0.0;
    }
    TEST_ASSERT_GREATER_THAN_INT(100, in_turn);
}
