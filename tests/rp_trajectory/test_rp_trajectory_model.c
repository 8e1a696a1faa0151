/* The reference motions as the instance sees them: the payload, what is refused.
 * test_trajectory.py has grasp and release. */
#include "last_text.h"
#include "model_test.h"
#include "rp_trajectory_example.h"
#include "rp_trajectory_model.h"

#include <math.h>
#include <unity.h>

static const int motions[] = {RP_TRAJECTORY_POINT_TO_POINT, RP_TRAJECTORY_LINE,
                              RP_TRAJECTORY_CIRCLE};
static struct rp_trajectory_values v;

void setUp(void) {
    v = (struct rp_trajectory_values){.parameters = rp_trajectory_example};
    v.parameters.start_angle = 0.25;
}

/* ---- The payload ---------------------------------------------------------------------------- */

static void test_what_comes_next_after_a_start(void) {
    const struct model_events *events = rp_trajectory_model.events;
    const struct {
        double release, start, next;
    } cases[] = {{2.5, 0.0, 1.25}, {2.5, 1.25, 2.5}, {2.5, 2.5, INFINITY}, {1.25, 0.0, INFINITY}};
    v.parameters.grasp_time = 1.25;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const struct event end_of_initialization = {.t = cases[i].start};
        v.parameters.release_time = cases[i].release;
        v.payload = RP_TRAJECTORY_UNDECIDED;
        ASSERT_OK(events->update(&v, &end_of_initialization));
        TEST_ASSERT_TRUE(events->next_time(&v) == cases[i].next);
        TEST_ASSERT_TRUE(events->modes_are_possible(&v, true));
        ASSERT_OK(rp_trajectory_model.outputs(&v, 0.0));
        TEST_ASSERT_EQUAL_INT(cases[i].next == 2.5, v.payload_attached);
    }
    // the last one has no grasp
    v.payload = RP_TRAJECTORY_ATTACHED;
    TEST_ASSERT_FALSE(events->modes_are_possible(&v, true));
    v.payload = RP_TRAJECTORY_UNDECIDED;
    TEST_ASSERT_FALSE(events->modes_are_possible(&v, true));
}

/* ---- What is refused ------------------------------------------------------------------------ */

static void assert_refused(const char *expected) {
    model_test_refused(&rp_trajectory_model, &v, expected);
}

static void assert_accepted(void) {
    model_test_accepted(&rp_trajectory_model, &v);
}

static void test_start_values_are_accepted(void) {
    for (size_t i = 0; i < 3; i++) {
        v.parameters.motion = motions[i];
        assert_accepted();
    }
}

static void test_a_circle_needs_a_frequency(void) {
    v.parameters.frequency = 0.0;
    assert_refused("frequency = 0 is refused: a circle needs one above or below 0");
}

static void test_a_circle_needs_time_for_its_ramps(void) {
    v.parameters.turns = 0.25;
    v.parameters.frequency = -0.5;
    v.parameters.ramp_time = 0.75;
    assert_refused("turns / |frequency| = 0.5 s is refused: it must be at least ramp_time = 0.75 s "
                   "(turns = 0.25, frequency = -0.5 Hz)");
    v.parameters.turns = 0.375; // just enough
    assert_accepted();
}

static void test_a_path_at_the_smallest_distance_is_refused(void) {
    v.parameters.motion = RP_TRAJECTORY_LINE;
    v.parameters.ee_from[0] = 0.5;
    v.parameters.ee_from[1] = v.parameters.ee_to[1] = 0.125;
    v.parameters.ee_to[0] = -0.5;
    v.parameters.a = -0.125;
    assert_refused(
        "the path to (0, 0.125) m is refused: there it is 0.125 m from the axis of "
        "joint 1, and it must stay beyond the smallest reachable distance |a| = 0.125 m");
    v.parameters.a = -0.1249;
    assert_accepted();
}

/* Zero is written without a sign, whatever the direction of the line. */
static void test_a_coordinate_of_zero_has_no_sign(void) {
    v.parameters.motion = RP_TRAJECTORY_LINE;
    for (int sign = -1; sign <= 1; sign += 2) {
        const double end = 0.5 * sign;
        v.parameters.ee_from[0] = v.parameters.ee_to[0] = 0.0625;
        v.parameters.ee_from[1] = -end;
        v.parameters.ee_to[1] = end;
        assert_refused(
            "the path to (0.0625, 0) m is refused: there it is 0.0625 m from the axis of "
            "joint 1, and it must stay beyond the smallest reachable distance |a| = "
            "0.1 m");
    }
}

static void test_a_circle_about_the_axis_is_everywhere_as_near(void) {
    v.parameters.center[0] = v.parameters.center[1] = 0.0;
    v.parameters.start_angle = 0.0;
    v.parameters.radius = 0.0625;
    assert_refused("the path to (0.0625, 0) m is refused: there it is 0.0625 m from the axis of "
                   "joint 1, and it must stay beyond the smallest reachable distance |a| = 0.1 m");
    v.parameters.radius = 0.125;
    assert_accepted();
}

static void test_a_release_before_the_grasp_is_refused(void) {
    v.parameters.grasp_time = 1.5;
    v.parameters.release_time = 1.25;
    assert_refused("release_time = 1.25 s is refused: it must not be before grasp_time = 1.5 s");
    v.parameters.release_time = 1.5;
    assert_accepted();
}
