/* Contacts with compliant stops: where they begin and end, their force, how an update changes
 * them. */
#include "plant_test_support.h"
#include "rp_plant_contact.h"
#include "unity.h"

#include <math.h>
#include <stdlib.h>

enum { LOWER2 = 6, UPPER2 = 7, PUSH2 = 9 }; /* indicators of the slide */

static const double stiffness = 1000.0;
static const double damping = 0.5;

static struct rp_plant_values v;

/* A slide without friction between -1 and 1, joint 1 held, no gravity, no offset; the first event
 * has been. */
void setUp(void) {
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

/* ---- Contacts ------------------------------------------------------------------------------- */

static void test_a_contact_begins_and_ends_on_the_limit(void) {
    for (int side = 1; side >= -1; side -= 2) {
        setUp();
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

/* An importer that steps past an event finds the contact of where it is. */
static void test_far_from_the_limit_the_position_stays(void) {
    put(-1.125, -0.3);
    plant_test_update(&v, LOWER2);
    assert_contact(RP_PLANT_PUSHED);
    TEST_ASSERT_TRUE(v.q[1] == -1.125);
    put(-0.875, 0.3);
    plant_test_update(&v, LOWER2);
    assert_contact(RP_PLANT_APART);
    TEST_ASSERT_TRUE(v.q[1] == -0.875);
}

static void test_contacts_follow_from_the_state_where_nothing_has_triggered(void) {
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
    v.parameters.stop_damping[1] = 0.0;
    put(-1.25, 1e6);
    plant_test_update(&v, -1);
    assert_contact(RP_PLANT_PUSHED);
    plant_test_outputs(&v);
    ASSERT_SAME(0.25 * stiffness, v.stop_force[1]);
    ASSERT_SAME(1.0, v.indicators[PUSH2]);
}

static void test_stops_that_are_switched_off_or_moved(void) {
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

/* ---- Forces and energies -------------------------------------------------------------------- */

static void test_force_energy_and_indicators(void) {
    const double d = 0.125;
    for (int side = 1; side >= -1; side -= 2) {
        setUp();
        put(-side * (1.0 + d), 1.5 * side);
        plant_test_update(&v, -1);
        plant_test_outputs(&v);
        const double push = 1.0 - damping * 1.5;
        ASSERT_CLOSE(side * stiffness * d * push, v.stop_force[1], 1e-12);
        ASSERT_CLOSE(v.stop_force[1] / v.parameters.arm.m2, v.ddq[1], 1e-12);
        TEST_ASSERT_TRUE(v.potential_energy == 0.5 * stiffness * d * d);
        TEST_ASSERT_TRUE(v.total_energy == v.potential_energy + v.kinetic_energy);
        TEST_ASSERT_TRUE(v.indicators[side > 0 ? LOWER2 : UPPER2] == d);
        TEST_ASSERT_TRUE(v.indicators[side > 0 ? UPPER2 : LOWER2] == 1.0);
        TEST_ASSERT_TRUE(v.indicators[PUSH2] == push);

        // let go: no force, and the energy that it does not give back is there still
        v.dq[1] = 3.0 * side;
        plant_test_update(&v, -1);
        plant_test_outputs(&v);
        TEST_ASSERT_TRUE(v.stop_force[1] == 0.0 && v.ddq[1] == 0.0);
        TEST_ASSERT_TRUE(v.potential_energy == 0.5 * stiffness * d * d);
        TEST_ASSERT_TRUE(v.indicators[PUSH2] == damping * 3.0 - 1.0);
    }
}

/* Until the modes are decided outputs are those of the state. */
static void test_a_start_in_a_stop(void) {
    v.modes = (struct rp_plant_modes){.payload = RP_PLANT_UNDECIDED};
    put(1.25, -3.0);
    plant_test_outputs(&v);
    TEST_ASSERT_TRUE(v.stop_force[1] == 0.0);
    put(1.25, 0.0);
    plant_test_outputs(&v);
    TEST_ASSERT_TRUE(v.stop_force[1] == -0.25 * stiffness);
    ASSERT_CLOSE(-0.25 * stiffness / v.parameters.arm.m2, v.ddq[1], 1e-12);
}

/* Friction against the stop's force, and a rigid stop of the other joint. */
static void test_friction_holds_a_joint_against_its_stop(void) {
    v.parameters.coulomb_friction[1] = 0.25 * stiffness;
    put(-1.25, 0.0);
    plant_test_update(&v, -1);
    plant_test_outputs(&v);
    TEST_ASSERT_EQUAL_INT(RP_PLANT_STUCK, v.modes.joint[1]);
    ASSERT_SAME(0.25 * stiffness, v.stop_force[1]);
    ASSERT_SAME(0.25 * stiffness, v.friction[1]);
    TEST_ASSERT_TRUE(v.ddq[1] == 0.0);
    put(-1.2500001, 0.0);
    plant_test_update(&v, -1);
    TEST_ASSERT_EQUAL_INT(RP_PLANT_FORWARD, v.modes.joint[1]);
}

/* ---- Saved states --------------------------------------------------------------------------- */

static void test_contacts_that_do_not_fit_the_state_are_impossible(void) {
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
