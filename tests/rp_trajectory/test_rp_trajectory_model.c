/* The reference motions as the instance sees them: the payload, what is refused.
 * test_trajectory.py has grasp and release. */
#include "equations.h"
#include "last_text.h"

#include <math.h>
#include <unity.h>

enum { POINT_TO_POINT = 1, LINE, CIRCLE };
static struct equations_values v;

void setUp(void) {
    v = (struct equations_values){
        .m_motion = CIRCLE,
        .m_branch = 1,
        .v_l1 = 0.5,
        .v_a = 0.1,
        .v_start_time = 0.5,
        .v_duration = 1.25,
        .v_ee_x_from = -0.5,
        .v_ee_y_from = 0.2,
        .v_ee_x_to = -0.3,
        .v_ee_y_to = -0.35,
        .v_x_center = 0.4,
        .v_y_center = 0.1,
        .v_radius = 0.1,
        .v_start_angle = 0.25,
        .v_frequency = 0.5,
        .v_turns = 2.0,
        .v_ramp_time = 1.0,
        .v_grasp_time = 0.75,
        .v_release_time = 1.5,
    };
}

/* ---- The payload ---------------------------------------------------------------------------- */

static void test_what_comes_next_after_a_start(void) {
    const struct model_events *events = equations_model.events;
    const struct {
        double release, start, next;
    } cases[] = {{2.5, 0.0, 1.25}, {2.5, 1.25, 2.5}, {2.5, 2.5, INFINITY}};
    v.v_grasp_time = 1.25;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const struct event end_of_initialization = {.t = cases[i].start};
        v.v_release_time = cases[i].release;
        v.is_begun = 0;
        ASSERT_OK(events->update(&v, &end_of_initialization));
        TEST_ASSERT_TRUE(events->next_time(&v) == cases[i].next);
        TEST_ASSERT_TRUE(events->modes_are_possible(&v, true));
        ASSERT_OK(equations_model.outputs(&v, 0.0));
        TEST_ASSERT_EQUAL_INT(cases[i].next == 2.5, v.m_payload_attached);
    }
}

/* ---- What is refused ------------------------------------------------------------------------ */

static void assert_check(enum status status, const char *expected) {
    char text[512] = "";
    TEST_ASSERT_EQUAL_INT(status, equations_model.check_parameters(&v, text, sizeof text));
    TEST_ASSERT_EQUAL_STRING(expected, text);
}

static void assert_refused(const char *expected) {
    assert_check(STATUS_INVALID_PARAMETERS, expected);
}

static void assert_accepted(void) {
    assert_check(STATUS_OK, "");
}

static void test_start_values_are_accepted(void) {
    for (v.m_motion = POINT_TO_POINT; v.m_motion <= CIRCLE; v.m_motion++) {
        assert_accepted();
    }
}

static void test_what_belongs_to_another_motion_is_not_checked(void) {
    v.v_frequency = 0.0;
    v.v_ramp_time = 1e9;
    v.m_motion = LINE;
    assert_accepted();
    v.v_ee_x_from = v.v_ee_y_from = 0.0;
    assert_refused("the path to (0, 0) m is refused: there it is 0 m from the axis of joint 1, and "
                   "it must stay beyond the smallest reachable distance |a| = 0.1 m");
    v.m_motion = POINT_TO_POINT;
    assert_accepted();
}

static void test_a_circle_needs_a_frequency(void) {
    v.v_frequency = 0.0;
    assert_refused("frequency = 0 is refused: a circle needs one above or below 0");
}

static void test_a_circle_needs_time_for_its_ramps(void) {
    v.v_turns = 0.25;
    v.v_frequency = -0.5;
    v.v_ramp_time = 0.75;
    assert_refused("turns / |frequency| = 0.5 s is refused: it must be at least ramp_time = 0.75 s "
                   "(turns = 0.25, frequency = -0.5 Hz)");
    v.v_turns = 0.375; // just enough
    assert_accepted();
}

static void test_a_path_at_the_smallest_distance_is_refused(void) {
    v.m_motion = LINE;
    v.v_ee_x_from = 0.5;
    v.v_ee_y_from = v.v_ee_y_to = 0.125;
    v.v_ee_x_to = -0.5;
    v.v_a = -0.125;
    assert_refused(
        "the path to (0, 0.125) m is refused: there it is 0.125 m from the axis of "
        "joint 1, and it must stay beyond the smallest reachable distance |a| = 0.125 m");
    v.v_a = -0.1249;
    assert_accepted();
}

/* Zero is written without a sign, whatever the direction of the line. */
static void test_a_coordinate_of_zero_has_no_sign(void) {
    v.m_motion = LINE;
    for (int sign = -1; sign <= 1; sign += 2) {
        const double end = 0.5 * sign;
        v.v_ee_x_from = v.v_ee_x_to = 0.0625;
        v.v_ee_y_from = -end;
        v.v_ee_y_to = end;
        assert_refused(
            "the path to (0.0625, 0) m is refused: there it is 0.0625 m from the axis of "
            "joint 1, and it must stay beyond the smallest reachable distance |a| = "
            "0.1 m");
    }
}

static void test_a_circle_about_the_axis_is_everywhere_as_near(void) {
    v.v_x_center = v.v_y_center = 0.0;
    v.v_start_angle = 0.0;
    v.v_radius = 0.0625;
    assert_refused("the path to (0.0625, 0) m is refused: there it is 0.0625 m from the axis of "
                   "joint 1, and it must stay beyond the smallest reachable distance |a| = 0.1 m");
    v.v_radius = 0.125;
    assert_accepted();
}

static void test_a_release_before_the_grasp_is_refused(void) {
    v.v_grasp_time = 1.5;
    v.v_release_time = 1.25;
    assert_refused("release_time = 1.25 s is refused: it must not be before grasp_time = 1.5 s");
    v.v_release_time = 1.5;
    assert_accepted();
}
