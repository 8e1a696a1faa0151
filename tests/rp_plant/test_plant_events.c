/* How an update changes modes, states and sums. The laws of impacts, grasps and decisions at rest
 * have other files. */
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
static struct rp_test_random random_source;
static struct rp_plant_values v;

/* Without gravity and offset, friction 3 in both joints; the first event has been. */
void setUp(void) {
    events = rp_plant_model.events;
    random_source.state = 61;
    plant_test_start(&v);
    v.parameters.arm.g = v.parameters.arm.a = 0.0;
    v.parameters.coulomb_friction[0] = v.parameters.coulomb_friction[1] = 3.0;
    plant_test_update(&v, -1);
}

static void assert_modes(int joint1, int joint2) {
    TEST_ASSERT_EQUAL_INT(joint1, v.modes.joint[0]);
    TEST_ASSERT_EQUAL_INT(joint2, v.modes.joint[1]);
}

static void indicators_now(double z[RP_PLANT_INDICATORS]) {
    double u[PLANT_INPUTS];
    const double x[PLANT_STATES] = {v.q[0], v.q[1], v.dq[0], v.dq[1]};
    memcpy(u, &v.inputs, sizeof u);
    ASSERT_OK(events->indicators(&v, 3.0, x, u, z));
}

static void trigger(int indicator, const double *du) {
    bool triggered[RP_PLANT_INDICATORS] = {false};
    triggered[indicator] = true;
    plant_test_update_with(&v, triggered, du);
}

/* ---- Any state ------------------------------------------------------------------------------ */

static void next_sample(void) {
    plant_test_random_plant(&random_source, &v);
    v.modes.payload = RP_PLANT_UNDECIDED;
    for (int i = 0; i < 2; i++) {
        const uint64_t bits = rp_test_random_bits(&random_source);
        v.parameters.restitution[i] = rp_test_uniform(&random_source, 0.0, 1.0);
        if (bits % 2 == 0) {
            v.dq[i] = 0.0;
        }
        v.parameters.lower[i] = bits % 3 == 0 ? v.q[i] : v.q[i] - 0.5;
        v.parameters.upper[i] = bits % 3 == 1 ? v.q[i] : v.q[i] + 0.5;
        v.parameters.stops[i] = bits % 5 == 0 ? RP_PLANT_STOPS_NONE : RP_PLANT_STOPS_RIGID;
        if (bits % 5 > 2) {
            v.parameters.stops[i] = RP_PLANT_STOPS_COMPLIANT;
            v.parameters.stop_stiffness[i] = 300.0;
            v.parameters.stop_damping[i] = 0.25 * (double)(bits % 4);
            v.q[i] += bits % 7 < 3 ? 0.0 : bits % 7 < 5 ? 0.75 : -0.75;
        }
    }
}

static void test_after_an_update_all_modes_are_valid(void) {
    for (int n = 0; n < 20 * RP_TEST_SAMPLES; n++) {
        double z[RP_PLANT_INDICATORS];
        next_sample();
        plant_test_update(&v, -1);
        plant_test_outputs(&v);
        indicators_now(z);
        for (int k = 0; k < RP_PLANT_INDICATORS; k++) {
            TEST_ASSERT_TRUE(z[k] >= 0.0);
            ASSERT_SAME(v.indicators[k], z[k]);
        }
        for (int i = 0; i < 2; i++) {
            const int mode = v.modes.joint[i];
            const int closed = plant_closed_stop(&v.parameters, i, v.q[i]);
            if (mode == RP_PLANT_STUCK) {
                TEST_ASSERT_TRUE(v.dq[i] == 0.0 && v.ddq[i] == 0.0);
            } else if (v.dq[i] == 0.0) {
                TEST_ASSERT_TRUE(mode == RP_PLANT_FREE || mode * v.ddq[i] > 0.0);
                TEST_ASSERT_TRUE(closed * v.ddq[i] >= 0.0);
            } else {
                TEST_ASSERT_TRUE(mode == RP_PLANT_FREE || mode * v.dq[i] > 0.0);
                TEST_ASSERT_TRUE(closed * v.dq[i] >= 0.0);
            }
        }
    }
}

static void test_a_second_update_changes_nothing(void) {
    int moved = 0;
    for (int n = 0; n < 20 * RP_TEST_SAMPLES; n++) {
        struct indicator first[RP_PLANT_INDICATORS] = {0};
        struct indicator second[RP_PLANT_INDICATORS] = {0};
        next_sample();
        plant_test_update(&v, -1);
        events->describe(&v, first);
        if (n % 2 == 0) { // a step later
            v.q[1] += v.modes.joint[1] == RP_PLANT_STUCK ? 0.0 : 0.125;
            v.dq[0] *= 0.5;
            v.dq[1] *= n % 4 == 0 ? 2.0 : -0.5;
            v.inputs.tau[0] *= -1.0;
            if (!events->moves_on(&v)) {
                continue;
            }
            moved++;
        }
        const struct rp_plant_values once = v;
        plant_test_update(&v, -1);
        TEST_ASSERT_EQUAL_MEMORY(&once, &v, sizeof v);
        events->describe(&v, second);
        for (int k = 0; k < RP_PLANT_INDICATORS; k++) {
            TEST_ASSERT_TRUE(first[k].kind == second[k].kind && first[k].state == second[k].state &&
                             first[k].factor == second[k].factor &&
                             first[k].offset == second[k].offset &&
                             first[k].rises == second[k].rises);
        }
    }
    TEST_ASSERT_TRUE(moved > 0);
}

static void test_description_gives_the_indicators(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        double z[RP_PLANT_INDICATORS];
        struct indicator described[RP_PLANT_INDICATORS];
        next_sample();
        plant_test_update(&v, -1);
        indicators_now(z);
        events->describe(&v, described);
        for (int k = 0; k < RP_PLANT_INDICATORS; k++) {
            const double x[PLANT_STATES] = {v.q[0], v.q[1], v.dq[0], v.dq[1]};
            const struct indicator *indicator = &described[k];
            if (indicator->kind == INDICATOR_OF_STATE) {
                ASSERT_SAME(indicator->offset + indicator->factor * x[indicator->state], z[k]);
            } else if (indicator->kind == INDICATOR_UNUSED) {
                ASSERT_SAME(1.0, z[k]);
            } else {
                TEST_ASSERT_EQUAL_INT(RP_PLANT_STUCK, v.modes.joint[k / 4]);
                TEST_ASSERT_TRUE(k % 4 < 2);
            }
        }
    }
}

/* Until initialization ends, values can be read that the first update does not change. */
static void test_before_the_first_event_modes_follow_from_the_state(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        next_sample();
        plant_test_outputs(&v);
        struct rp_plant_values first = v;
        plant_test_update(&v, -1);
        plant_test_outputs(&v);
        if (memcmp(first.dq, v.dq, sizeof v.dq) == 0 && first.q[0] == v.q[0]) {
            for (int i = 0; i < 2; i++) {
                ASSERT_SAME(v.ddq[i], first.ddq[i]);
                ASSERT_SAME(v.friction[i], first.friction[i]);
            }
            ASSERT_SAME(v.kinetic_energy, first.kinetic_energy);
        }
    }
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
    for (int mode = -2; mode <= 3; mode++) {
        const bool is_joint_mode = mode >= -1 && mode <= 2;
        TEST_ASSERT_EQUAL_INT(is_joint_mode,
                              rp_plant_modes_exist(&(struct rp_plant_modes){{mode, 0}, 1, {0, 0}}));
        TEST_ASSERT_EQUAL_INT(is_joint_mode,
                              rp_plant_modes_exist(&(struct rp_plant_modes){{0, mode}, 1, {0, 0}}));
        TEST_ASSERT_EQUAL_INT(mode >= 0 && mode <= 2,
                              rp_plant_modes_exist(&(struct rp_plant_modes){{0, 0}, mode, {0, 0}}));
        TEST_ASSERT_EQUAL_INT(mode <= 2,
                              rp_plant_modes_exist(&(struct rp_plant_modes){{0, 0}, 1, {mode, 0}}));
        TEST_ASSERT_EQUAL_INT(mode <= 2,
                              rp_plant_modes_exist(&(struct rp_plant_modes){{0, 0}, 1, {0, mode}}));
    }
    TEST_ASSERT_FALSE(rp_plant_modes_exist(&(struct rp_plant_modes){{0, 0}, 1, {-3, 0}}));
    TEST_ASSERT_FALSE(rp_plant_modes_exist(&(struct rp_plant_modes){{0, 0}, 1, {0, INT_MIN}}));
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
        v.modes.payload = RP_PLANT_UNDECIDED;
        TEST_ASSERT_FALSE(events->modes_are_possible(&v, false));
    }
}

/* What update leaves is possible, wherever it starts from. */
static void test_modes_after_an_update_are_possible(void) {
    for (int i = 0; i < 20000; i++) {
        plant_test_random_plant(&random_source, &v);
        for (int joint = 0; joint < 2; joint++) {
            v.dq[joint] = i / (2 + 2 * joint) % 3 == 0 ? 0.0 : v.dq[joint];
            if (i % 5 < 3) {
                v.parameters.stops[joint] =
                    (i + joint) % 7 < 3 ? RP_PLANT_STOPS_COMPLIANT : RP_PLANT_STOPS_RIGID;
                v.parameters.stop_stiffness[joint] = 100.0;
                v.parameters.stop_damping[joint] = i % 2 == 0 ? 0.0 : 1.0;
                v.parameters.lower[joint] = v.q[joint] - (i % 5 == 0 ? 0.0 : 0.5);
                v.parameters.upper[joint] = v.q[joint] + (i % 5 == 1 ? 0.0 : 0.5);
                v.parameters.restitution[joint] = 0.5 * joint;
            }
        }
        plant_test_update(&v, i % 13 < RP_PLANT_INDICATORS ? i % 13 : -1);
        TEST_ASSERT_TRUE(events->modes_are_possible(&v, true));
    }
}
