/* How an update changes modes, states and sums, case by case: friction at its limit, the end of
 * bouncing, limits that move, contacts. test_plant_laws.c has what holds at any state,
 * fmu/test_plant_zero_indicators.py each indicator at and around its root. */
#include "last_text.h"
#include "plant_test_support.h"
#include "rp_plant_equations.h"
#include "unity.h"

#include <limits.h>
#include <math.h>
#include <string.h>

enum {
    FORWARD1,
    BACKWARD1,
    LOWER1,
    UPPER1,
    FORWARD2,
    BACKWARD2,
    LOWER2,
    UPPER2,
    PUSH1,
    PUSH2,
};

static const struct model_events *events;
static struct rp_plant_values v;

/* Without gravity and offset, friction 3 in both joints; the first event has been. */
void setUp(void) {
    events = rp_plant_model.events;
    plant_test_start(&v);
    v.parameters.arm.g = v.parameters.arm.a = 0.0;
    v.parameters.coulomb_friction[0] = v.parameters.coulomb_friction[1] = 3.0;
    plant_test_update(&v, -1);
}

static void assert_modes(int joint1, int joint2) {
    TEST_ASSERT_EQUAL_INT(joint1, v.modes.joint[0]);
    TEST_ASSERT_EQUAL_INT(joint2, v.modes.joint[1]);
}

static void trigger(int indicator, const double *du) {
    bool triggered[RP_PLANT_INDICATORS] = {false};
    triggered[indicator] = true;
    plant_test_update_with(&v, triggered, du);
}

/* ---- Friction ------------------------------------------------------------------------------- */

static void test_a_joint_that_halts_sticks_or_turns_back(void) {
    v.dq[1] = 2.0;
    plant_test_update(&v, -1);
    assert_modes(RP_PLANT_STUCK, RP_PLANT_FORWARD);
    v.dq[1] = 1e-17;
    v.inputs.tau[1] = -2.0;
    plant_test_update(&v, FORWARD2);
    assert_modes(RP_PLANT_STUCK, RP_PLANT_STUCK);
    TEST_ASSERT_TRUE(v.dq[1] == 0.0);

    v.modes.joint[1] = RP_PLANT_FORWARD;
    v.dq[1] = -1e-17; // past 0 by rounding
    v.inputs.tau[1] = -4.0;
    plant_test_update(&v, FORWARD2);
    assert_modes(RP_PLANT_STUCK, RP_PLANT_BACKWARD);
    TEST_ASSERT_TRUE(v.dq[1] == 0.0);
}

static void test_at_breakaway_the_rate_decides(void) {
    const double tau2 = v.parameters.coulomb_friction[1];
    for (int side = -1; side <= 1; side += 2) {
        const double on[PLANT_INPUTS] = {0.0, 0.5 * side};
        const double back[PLANT_INPUTS] = {0.0, -0.5 * side};
        const struct rp_plant_values held = v;
        const int indicator = side > 0 ? FORWARD2 : BACKWARD2;
        v.inputs.tau[1] = side * nextafter(tau2, 0.0); // the root, to rounding
        trigger(indicator, on);
        assert_modes(RP_PLANT_STUCK, side);
        v = held;
        trigger(indicator, back);
        assert_modes(RP_PLANT_STUCK, RP_PLANT_STUCK);
        trigger(indicator, NULL);
        assert_modes(RP_PLANT_STUCK, side);

        // an input that jumps to the limit: nothing has triggered
        v = held;
        v.inputs.tau[1] = side * tau2;
        plant_test_update(&v, -1);
        assert_modes(RP_PLANT_STUCK, RP_PLANT_STUCK);
        plant_test_update_with(&v, NULL, back);
        assert_modes(RP_PLANT_STUCK, RP_PLANT_STUCK);
        plant_test_update_with(&v, NULL, on);
        assert_modes(RP_PLANT_STUCK, side);
        v = held;
    }
}

/* The force of a held joint that follows from the motion of the other one: m2 L dq1^2 */
static void test_centrifugal_force_throws_the_slide_out(void) {
    const double m2L = v.parameters.arm.m2 * v.parameters.arm.l1;
    const double limit = sqrt(v.parameters.coulomb_friction[1] / m2L);
    for (int side = -1; side <= 1; side += 2) {
        v.dq[0] = limit;
        v.modes.joint[0] = RP_PLANT_FORWARD;
        v.modes.joint[1] = RP_PLANT_STUCK;
        v.inputs.tau[0] = 3.0 + side; // faster, or slower against its friction
        plant_test_update(&v, FORWARD2);
        assert_modes(RP_PLANT_FORWARD, side > 0 ? RP_PLANT_FORWARD : RP_PLANT_STUCK);
    }
}

/* Both joints at their limits: each would leave by itself, but the faster one pulls the other
 * back. With a = 1/2, m2 = 1: D12 = -1/2, and joint 2 leaving backward takes joint 1 along. */
static void test_two_joints_at_their_limits(void) {
    v.parameters.arm.a = 0.5;
    v.inputs.tau[0] = 3.0;
    v.inputs.tau[1] = -3.0;
    const double D11 = rp_test_inertia(&v.parameters.arm, 0.0) + 0.25;
    const struct {
        double rates[2];
        int modes[2];
    } cases[] = {
        {{1.0, 0.0}, {RP_PLANT_FORWARD, RP_PLANT_STUCK}},
        {{1.0, 0.5}, {RP_PLANT_FORWARD, RP_PLANT_STUCK}},
        {{0.0, -1.0}, {RP_PLANT_STUCK, RP_PLANT_BACKWARD}},
        // D12 (-1) = 1/2 is what joint 2 brings to row 1: below it joint 1 stays
        {{0.25, -1.0}, {RP_PLANT_STUCK, RP_PLANT_BACKWARD}},
        {{0.75, -1.0}, {RP_PLANT_FORWARD, RP_PLANT_BACKWARD}},
        {{1.0, -0.25 / D11}, {RP_PLANT_FORWARD, RP_PLANT_STUCK}},
        {{1.0, -1.0 / D11}, {RP_PLANT_FORWARD, RP_PLANT_BACKWARD}},
        {{-1.0, 1.0}, {RP_PLANT_STUCK, RP_PLANT_STUCK}},
    };
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        const double du[PLANT_INPUTS] = {cases[n].rates[0], cases[n].rates[1]};
        plant_test_update_with(&v, NULL, du);
        assert_modes(cases[n].modes[0], cases[n].modes[1]);
    }
}

/* A slide that moves loads the held joint 1 through the offset. */
static void test_what_triggers_counts_only_where_forces_have_not_jumped(void) {
    v.parameters.arm.a = 0.5;
    v.modes.joint[1] = RP_PLANT_FORWARD;
    v.inputs.tau[0] = 3.0 - 1e-3;
    bool triggered[RP_PLANT_INDICATORS] = {false};
    triggered[FORWARD1] = triggered[FORWARD2] = true; // the slide halts, joint 1 is then held
    const double du[PLANT_INPUTS] = {1.0};
    plant_test_update_with(&v, triggered, du);
    assert_modes(RP_PLANT_STUCK, RP_PLANT_STUCK);
}

/* The rotation would throw the slide out, but ends at the stop of joint 1 at the same time. */
static void test_what_triggers_does_not_count_where_an_impact_ends_the_rotation(void) {
    const double m2L = v.parameters.arm.m2 * v.parameters.arm.l1;
    v.dq[0] = sqrt(v.parameters.coulomb_friction[1] / m2L);
    v.modes.joint[0] = RP_PLANT_FORWARD;
    v.parameters.stops[0] = RP_PLANT_STOPS_RIGID;
    v.parameters.lower[0] = v.q[0] - 1.0;
    v.parameters.upper[0] = v.q[0];
    bool triggered[RP_PLANT_INDICATORS] = {false};
    triggered[UPPER1] = triggered[FORWARD2] = true;
    plant_test_update_with(&v, triggered, NULL);
    TEST_ASSERT_TRUE(v.dq[0] == 0.0);
    assert_modes(RP_PLANT_STUCK, RP_PLANT_STUCK);
}

/* The load that would have drawn the slide down is let go at the same time. */
static void test_what_triggers_does_not_count_where_the_payload_is_released(void) {
    v.parameters.arm.g = 2.0;
    v.parameters.payload_mass = 0.5; // with link 2 it weighs 3, which is the limit
    v.q[0] = RP_TEST_PI / 2.0;
    v.parameters.coulomb_friction[0] = 50.0;
    v.payload_attached = 1;
    plant_test_update(&v, -1);
    assert_modes(RP_PLANT_STUCK, RP_PLANT_STUCK);
    const struct rp_plant_values attached = v;
    plant_test_update(&v, BACKWARD2);
    assert_modes(RP_PLANT_STUCK, RP_PLANT_BACKWARD);
    v = attached;
    v.payload_attached = 0;
    plant_test_update(&v, BACKWARD2);
    assert_modes(RP_PLANT_STUCK, RP_PLANT_STUCK);
}

static void test_at_rest(void) {
    TEST_ASSERT_TRUE(events->is_at_rest(&v));
    v.dq[0] = 1.0;
    plant_test_update(&v, -1);
    assert_modes(RP_PLANT_FORWARD, RP_PLANT_STUCK);
    TEST_ASSERT_FALSE(events->is_at_rest(&v));
}

/* ---- Rigid stops ---------------------------------------------------------------------------- */

static void set_stops(int joint, double lower, double upper, double restitution) {
    v.parameters.stops[joint] = RP_PLANT_STOPS_RIGID;
    v.parameters.lower[joint] = lower;
    v.parameters.upper[joint] = upper;
    v.parameters.restitution[joint] = restitution;
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

/* Where nothing has triggered; no other contact fits the state, but on the limit either. */
static void test_contacts_follow_from_the_state(void) {
    const struct {
        double q, dq;
        int contact;
    } cases[] = {
        {0.5, 9.0, 0},   {-1.25, 0.0, 1},  {-1.25, 1.9, 1},  {-1.25, 2.1, 2},  {-1.0, 1.0, 0},
        {-1.0, -1.0, 1}, {1.25, -1.9, -1}, {1.25, -2.1, -2}, {1.0, 0.001, -1}, {1.0, -9.0, 0},
    };
    set_slide_between_compliant_stops();
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        const double q = cases[n].q, dq = cases[n].dq;
        put(q, dq);
        plant_test_update(&v, -1);
        assert_contact(cases[n].contact);
        TEST_ASSERT_TRUE(v.q[1] == q && v.dq[1] == dq);
        const bool is_on_limit = fabs(q) == 1.0;
        const int touching = q < 0.0 ? 1 : -1; // pushed, or let go where it is fast
        const int other = touching * (touching * dq > 1.0 / damping ? 2 : 1);
        for (int contact = -3; contact <= 3; contact++) {
            v.modes.contact[1] = contact;
            const bool fits =
                contact == cases[n].contact || (is_on_limit && (contact == other || contact == 0));
            TEST_ASSERT_EQUAL_INT(fits, events->modes_are_possible(&v, true));
        }
        v.modes.contact[1] = cases[n].contact;
    }
    v.modes.contact[0] = RP_PLANT_PUSHED;
    TEST_ASSERT_FALSE(events->modes_are_possible(&v, true));
}

static void test_at_rest_on_the_limit_the_force_decides(void) {
    set_slide_between_compliant_stops();
    for (int direction = -1; direction <= 1; direction++) {
        for (int limit = 1; limit >= -1; limit -= 2) {
            put(limit, 0.0);
            v.inputs.tau[1] = 2.0 * direction;
            plant_test_update(&v, -1);
            assert_contact(direction == limit ? -limit * RP_PLANT_PUSHED : RP_PLANT_APART);
            TEST_ASSERT_EQUAL_INT(RP_PLANT_FREE, v.modes.joint[1]);
        }
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

/* Where it breaks away, the force equals the friction and gives no acceleration: the mode says. */
static void test_a_joint_that_breaks_away_on_the_limit_goes_where_its_mode_says(void) {
    for (int side = -1; side <= 1; side += 2) {
        const double du[PLANT_INPUTS] = {0.0, side};
        set_slide_between_compliant_stops();
        v.parameters.coulomb_friction[1] = 2.0;
        put(-1.0, 0.0);
        v.inputs.tau[1] = 2.0 * side;
        plant_test_update_with(&v, NULL, du);
        assert_modes(RP_PLANT_STUCK, side);
        assert_contact(side < 0 ? RP_PLANT_PUSHED : RP_PLANT_APART);
    }
}

/* The velocity 1 / c is written to the bit, so that the next search begins at 0. */
static void test_a_stop_lets_go_and_pushes_again(void) {
    set_slide_between_compliant_stops();
    put(-1.25, 1.0);
    plant_test_update(&v, -1);
    for (int contact = RP_PLANT_LET_GO; contact >= RP_PLANT_PUSHED; contact--) {
        put(-1.125, 1.0 / damping + (contact == RP_PLANT_PUSHED ? 1e-13 : -1e-13));
        trigger(PUSH2, NULL);
        assert_contact(contact);
        TEST_ASSERT_TRUE(v.dq[1] == 1.0 / damping);
    }
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

/* ---- struct model_events -------------------------------------------------------------------- */

static void test_when_events_are_possible(void) {
    struct rp_plant_parameters *p = &v.parameters;
    const struct rp_plant_values start = {.parameters.arm = p->arm};
    v = start;
    TEST_ASSERT_FALSE(events->are_possible(&v));
    double *const each[] = {&p->coulomb_friction[0], &p->breakaway_friction[1], &p->payload_mass,
                            &p->payload_inertia};
    for (size_t i = 0; i < sizeof each / sizeof each[0]; i++) {
        *each[i] = 1.0;
        TEST_ASSERT_TRUE(events->are_possible(&v));
        v = start;
    }
    p->stops[1] = RP_PLANT_STOPS_RIGID;
    TEST_ASSERT_TRUE(events->are_possible(&v));
    p->stops[1] = RP_PLANT_STOPS_COMPLIANT;
    TEST_ASSERT_TRUE(events->are_possible(&v));
}

static void test_modes_that_exist(void) {
    const struct {
        int *mode, first, last;
    } each[] = {
        {&v.modes.joint[0], -1, 2},   {&v.modes.joint[1], -1, 2},   {&v.modes.payload, 1, 2},
        {&v.modes.contact[0], -2, 2}, {&v.modes.contact[1], -2, 2},
    };
    const int modes[] = {INT_MIN, -3, -2, -1, 0, 1, 2, 3};
    for (size_t k = 0; k < sizeof each / sizeof each[0]; k++) {
        const int kept = *each[k].mode;
        for (size_t n = 0; n < sizeof modes / sizeof modes[0]; n++) {
            *each[k].mode = modes[n];
            TEST_ASSERT_EQUAL_INT(modes[n] >= each[k].first && modes[n] <= each[k].last,
                                  events->modes_are_possible(&v, false));
        }
        *each[k].mode = kept;
    }
}

/* With parameters that have been set since, any decided mode is possible; with those that it was
 * decided with, only what can hold, slide or move freely there. */
static void test_modes_that_fit_parameters_and_states(void) {
    static const bool has_friction[] = {true, false};
    for (int k = 0; k < 2; k++) {
        for (int joint = 0; joint < 2; joint++) {
            plant_test_start(&v);
            v.parameters.coulomb_friction[joint] = has_friction[k] ? 1.0 : 0.0;
            v.dq[1 - joint] = 1.0;
            plant_test_update(&v, -1);
            TEST_ASSERT_TRUE(events->modes_are_possible(&v, true));
            for (int mode = RP_PLANT_BACKWARD; mode <= RP_PLANT_FREE; mode++) {
                v.modes.joint[joint] = mode;
                TEST_ASSERT_TRUE(events->modes_are_possible(&v, false));
                TEST_ASSERT_EQUAL_INT((mode != RP_PLANT_FREE) == has_friction[k],
                                      events->modes_are_possible(&v, true));
            }
        }
    }
}

static void test_a_joint_is_held_at_rest_by_friction_or_on_a_stop(void) {
    for (int joint = 0; joint < 2; joint++) {
        plant_test_start(&v);
        v.modes =
            (struct rp_plant_modes){{RP_PLANT_FREE, RP_PLANT_FREE}, RP_PLANT_RELEASED, {0, 0}};
        v.modes.joint[joint] = RP_PLANT_STUCK;
        v.parameters.lower[joint] = -1.0;
        v.parameters.upper[joint] = 0.5;
        v.q[joint] = 0.5;
        TEST_ASSERT_FALSE(events->modes_are_possible(&v, true));
        v.parameters.stops[joint] = RP_PLANT_STOPS_RIGID;
        TEST_ASSERT_TRUE(events->modes_are_possible(&v, true));
        v.q[joint] = 0.49;
        TEST_ASSERT_FALSE(events->modes_are_possible(&v, true));
        v.q[joint] = -1.0;
        TEST_ASSERT_TRUE(events->modes_are_possible(&v, true));
        v.dq[joint] = 1e-300;
        TEST_ASSERT_FALSE(events->modes_are_possible(&v, true));
    }
}
