/* Stops: how an update changes what meets them. Rigid ones: the end of bouncing, limits that move,
 * impacts in turn; test_plant_impact.c has their law. Compliant ones: where contacts begin and end.
 * Forces and energies: fmu/test_plant_fmu.py, the references, the random motions. */
#include "plant_test_support.h"
#include "rp_plant_contact.h"
#include "unity.h"

#include <math.h>
#include <stdlib.h>

enum { LOWER2 = 6, UPPER2 = 7, PUSH2 = 9 }; /* indicators of the slide */

static struct rp_plant_values v;

/* Without gravity and offset, friction 3 in both joints; the first event has been. */
void setUp(void) {
    plant_test_start(&v);
    v.parameters.arm.g = v.parameters.arm.a = 0.0;
    v.parameters.coulomb_friction[0] = v.parameters.coulomb_friction[1] = 3.0;
    plant_test_update(&v, -1);
}

/* ---- Rigid stops ---------------------------------------------------------------------------- */

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

/* ---- Compliant stops ------------------------------------------------------------------------ */

static const double stiffness = 1000.0;
static const double damping = 0.5;

/* A slide without friction between -1 and 1, joint 1 held, no gravity, no offset; the first event
 * has been. */
static void set_slide_between_compliant_stops(void) {
    plant_test_start(&v);
    v.parameters.arm.g = v.parameters.arm.a = 0.0;
    v.parameters.coulomb_friction[0] = 1000.0;
    v.parameters.stops[1] = RP_PLANT_STOPS_COMPLIANT;
    v.parameters.lower[1] = -1.0;
    v.parameters.upper[1] = 1.0;
    v.parameters.stop_stiffness[1] = stiffness;
    v.parameters.stop_damping[1] = damping;
    plant_test_update(&v, -1);
}

static void assert_contact(int expected) {
    TEST_ASSERT_EQUAL_INT(expected, v.modes.contact[1]);
    TEST_ASSERT_EQUAL_INT(RP_PLANT_APART, v.modes.contact[0]);
}

static void put(double q2, double dq2) {
    v.q[1] = q2;
    v.dq[1] = dq2;
}

static void test_a_contact_begins_and_ends_on_the_limit(void) {
    for (int side = 1; side >= -1; side -= 2) {
        set_slide_between_compliant_stops();
        const int indicator = side > 0 ? LOWER2 : UPPER2;
        put(nextafter(-side, 0.0), -0.3 * side);
        plant_test_update(&v, indicator);
        assert_contact(side * RP_PLANT_PUSHED);
        TEST_ASSERT_TRUE(v.q[1] == -side && v.dq[1] == -0.3 * side);

        put(-side * (1.0 + 1e-12), 0.2 * side);
        plant_test_update(&v, indicator);
        assert_contact(RP_PLANT_APART);
        TEST_ASSERT_TRUE(v.q[1] == -side && v.dq[1] == 0.2 * side);
        TEST_ASSERT_TRUE(v.sums.stop_impulse[1] == 0.0 && v.sums.impact_loss == 0.0);
    }
}

static void test_contacts_follow_from_the_state_where_nothing_has_triggered(void) {
    set_slide_between_compliant_stops();
    const struct {
        double q, dq;
        int contact;
    } cases[] = {
        {0.5, 9.0, 0},   {-1.25, 0.0, 1},  {-1.25, 1.9, 1},  {-1.25, 2.1, 2},  {-1.0, 1.0, 0},
        {-1.0, -1.0, 1}, {1.25, -1.9, -1}, {1.25, -2.1, -2}, {1.0, 0.001, -1}, {1.0, -9.0, 0},
    };
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        put(cases[n].q, cases[n].dq);
        plant_test_update(&v, -1);
        assert_contact(cases[n].contact);
        TEST_ASSERT_TRUE(v.q[1] == cases[n].q && v.dq[1] == cases[n].dq);
    }
}

static void test_at_rest_on_the_limit_the_force_decides(void) {
    set_slide_between_compliant_stops();
    for (int direction = -1; direction <= 1; direction++) {
        put(-1.0, 0.0);
        v.inputs.tau[1] = 2.0 * direction;
        plant_test_update(&v, -1);
        assert_contact(direction < 0 ? RP_PLANT_PUSHED : RP_PLANT_APART);
        TEST_ASSERT_EQUAL_INT(RP_PLANT_FREE, v.modes.joint[1]);
    }
    // friction that holds the joint leaves it apart, less of it lets it go into the stop
    v.inputs.tau[1] = -2.0;
    v.parameters.coulomb_friction[1] = 3.0;
    plant_test_update(&v, -1);
    assert_contact(RP_PLANT_APART);
    TEST_ASSERT_EQUAL_INT(RP_PLANT_STUCK, v.modes.joint[1]);
    v.parameters.coulomb_friction[1] = 1.0;
    plant_test_update(&v, -1);
    assert_contact(RP_PLANT_PUSHED);
    TEST_ASSERT_EQUAL_INT(RP_PLANT_BACKWARD, v.modes.joint[1]);
}

/* Where it breaks away, the force equals the friction and gives no acceleration: the mode tells. */
static void test_a_joint_that_breaks_away_on_the_limit_goes_where_its_mode_says(void) {
    set_slide_between_compliant_stops();
    static const struct {
        int mode, contact;
    } cases[] = {{RP_PLANT_BACKWARD, RP_PLANT_PUSHED}, {RP_PLANT_FORWARD, RP_PLANT_APART}};
    v.parameters.coulomb_friction[1] = 2.0;
    for (int i = 0; i < 2; i++) {
        struct rp_plant_modes modes = v.modes;
        put(-1.0, 0.0);
        v.inputs.tau[1] = 2.0 * cases[i].mode;
        modes.joint[1] = cases[i].mode;
        rp_plant_begin_contacts(&v.parameters, v.q, v.dq, &v.inputs, &modes);
        TEST_ASSERT_EQUAL_INT(cases[i].contact, modes.contact[1]);
    }
}

/* The velocity 1 / c is written to the bit, so that the next search begins at 0. */
static void test_a_stop_lets_go_and_pushes_again(void) {
    set_slide_between_compliant_stops();
    put(-1.25, 1.0);
    plant_test_update(&v, -1);
    assert_contact(RP_PLANT_PUSHED);
    put(-1.125, 2.0 - 1e-13);
    plant_test_update(&v, PUSH2);
    assert_contact(RP_PLANT_LET_GO);
    TEST_ASSERT_TRUE(v.dq[1] == 1.0 / damping);
    plant_test_update(&v, -1);
    assert_contact(RP_PLANT_LET_GO);

    put(-1.0625, 2.0 + 1e-13);
    plant_test_update(&v, PUSH2);
    assert_contact(RP_PLANT_PUSHED);
    TEST_ASSERT_TRUE(v.dq[1] == 1.0 / damping);
    plant_test_outputs(&v);
    TEST_ASSERT_TRUE(v.stop_force[1] == 0.0 && v.indicators[PUSH2] == 0.0);
}

/* Undamped stops let nothing go, however fast the joint is. */
static void test_without_damping_the_stop_always_pushes(void) {
    set_slide_between_compliant_stops();
    v.parameters.stop_damping[1] = 0.0;
    put(-1.25, 1e6);
    plant_test_update(&v, -1);
    assert_contact(RP_PLANT_PUSHED);
    plant_test_outputs(&v);
    ASSERT_SAME(0.25 * stiffness, v.stop_force[1]);
    ASSERT_SAME(1.0, v.indicators[PUSH2]);
}

static void test_stops_that_are_switched_off_or_moved(void) {
    set_slide_between_compliant_stops();
    put(-1.25, 0.0);
    plant_test_update(&v, -1);
    v.parameters.lower[1] = -2.0;
    plant_test_update(&v, -1);
    assert_contact(RP_PLANT_APART);
    v.parameters.upper[1] = -1.5;
    plant_test_update(&v, -1);
    assert_contact(-RP_PLANT_PUSHED);
    v.parameters.stops[1] = RP_PLANT_STOPS_NONE;
    plant_test_outputs(&v);
    TEST_ASSERT_TRUE(v.stop_force[1] == 0.0 && v.ddq[1] == 0.0);
    plant_test_update(&v, -1);
    assert_contact(RP_PLANT_APART);
    TEST_ASSERT_TRUE(v.q[1] == -1.25);
}

static void test_contacts_that_do_not_fit_the_state_are_impossible(void) {
    set_slide_between_compliant_stops();
    const struct {
        double q, dq;
        int contact;
    } cases[] = {{0.0, 1.0, 0},   {-1.0, 1.0, 0},  {-1.25, 1.0, 1},
                 {-1.25, 2.5, 2}, {1.25, 0.0, -1}, {1.25, -2.5, -2}};
    const struct model_events *events = rp_plant_model.events;
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        put(cases[n].q, cases[n].dq);
        plant_test_update(&v, -1);
        for (int contact = -3; contact <= 3; contact++) {
            v.modes.contact[1] = contact;
            const bool could_be =
                contact == cases[n].contact || (cases[n].q == -1.0 && contact == RP_PLANT_PUSHED);
            TEST_ASSERT_EQUAL_INT(could_be, events->modes_are_possible(&v, true));
            TEST_ASSERT_EQUAL_INT(abs(contact) < 3, events->modes_are_possible(&v, false));
        }
        v.modes.contact[1] = cases[n].contact;
    }
    v.modes.contact[0] = RP_PLANT_PUSHED;
    TEST_ASSERT_FALSE(events->modes_are_possible(&v, true));
}
