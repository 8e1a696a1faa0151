/* The reference motions at their ends, distances of paths, and a model without states. Outputs and
 * their derivatives are compared with 40 digits in test_trajectory.py. */
#include "continuous_states.h"
#include "instance.h"
#include "last_text.h"
#include "model_description.h"
#include "rp_trajectory_equations.h"
#include "rp_trajectory_example.h"
#include "rp_trajectory_model.h"

#include <math.h>
#include <unity.h>

static const double pi = 3.14159265358979323846;
static struct rp_trajectory_parameters p;

void setUp(void) {
    p = rp_trajectory_example;
    last_text[0] = '\0';
}
/* The circle that contains the axis of joint 1. */
static void set_around(void) {
    p.center[0] = 0.05;
    p.center[1] = -0.1;
    p.radius = 0.45;
    p.start_angle = 2.0;
    p.frequency = -0.8;
    p.turns = 4.75;
}

static struct trajectory_point at(double t) {
    struct trajectory_point x;
    trajectory_evaluate(&p, t, &x);
    return x;
}

static double end_time(void) {
    return p.motion == RP_TRAJECTORY_CIRCLE
               ? p.start_time + p.turns / fabs(p.frequency) + p.ramp_time
               : p.start_time + p.duration;
}

/* ---- Geometry ------------------------------------------------------------------------------- */

/* Near an end the way that is left has all its digits: s(x) = 10 x^3 - 15 x^4 + 6 x^5 of 1e-10. */
static void test_small_ways_near_an_end_keep_their_digits(void) {
    const double duration = 100.0;
    const double x = 0.02 / duration;
    const double s = x * x * x * (10.0 + x * (-15.0 + x * 6.0));
    p.motion = RP_TRAJECTORY_POINT_TO_POINT;
    p.start_time = 0.0;
    p.duration = duration;
    for (int i = 0; i < 2; i++) {
        p.q_from[i] = 0.0;
        p.q_to[i] = 1.0;
    }
    const double first = at(0.02).q[0].position;
    TEST_ASSERT_DOUBLE_WITHIN(1e-12 * s, s, first);
    p.q_from[0] = -1.0;
    p.q_to[0] = 0.0;
    const double last = at(duration - 0.02).q[0].position;
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * s, -s, last);
}

static void test_ends_are_reached_exactly(void) {
    p.motion = RP_TRAJECTORY_POINT_TO_POINT;
    for (int i = 0; i < 2; i++) {
        TEST_ASSERT_TRUE(at(p.start_time).q[i].position == p.q_from[i]);
        TEST_ASSERT_TRUE(at(end_time()).q[i].position == p.q_to[i]);
    }
    p.motion = RP_TRAJECTORY_LINE;
    for (int i = 0; i < 2; i++) {
        TEST_ASSERT_TRUE(at(p.start_time).ee[i].position == p.ee_from[i]);
        TEST_ASSERT_TRUE(at(end_time()).ee[i].position == p.ee_to[i]);
    }
    p.motion = RP_TRAJECTORY_CIRCLE;
    p.turns = 2.25;
    TEST_ASSERT_DOUBLE_WITHIN(2e-16, p.center[0], at(end_time()).ee[0].position);
    TEST_ASSERT_DOUBLE_WITHIN(2e-16, p.center[1] + p.radius, at(end_time()).ee[1].position);
}

/* ---- What is refused ------------------------------------------------------------------------ */

static void test_distance_of_a_line(void) {
    double nearest[2];
    p.motion = RP_TRAJECTORY_LINE;
    p.ee_from[0] = -1.0;
    p.ee_to[0] = 2.0;
    p.ee_from[1] = p.ee_to[1] = 0.25;
    TEST_ASSERT_DOUBLE_WITHIN(1e-16, 0.25, rp_trajectory_distance(&p, nearest));
    TEST_ASSERT_DOUBLE_WITHIN(1e-16, 0.0, nearest[0]);
    p.ee_to[0] = -0.3; // ends before the foot of the perpendicular
    p.ee_to[1] = 0.4;
    TEST_ASSERT_DOUBLE_WITHIN(1e-16, 0.5, rp_trajectory_distance(&p, nearest));
    TEST_ASSERT_TRUE(nearest[0] == -0.3 && nearest[1] == 0.4);
    p.ee_from[0] = p.ee_to[0]; // a line of no length
    p.ee_from[1] = p.ee_to[1];
    TEST_ASSERT_DOUBLE_WITHIN(1e-16, 0.5, rp_trajectory_distance(&p, nearest));
}

/* Against the nearest of many points of the swept arc. */
static void test_distance_of_an_arc(void) {
    for (int i = 0; i < 12 * 6 * 2; i++) {
        p = rp_trajectory_example;
        if (i % 2 == 1) {
            set_around();
        }
        p.start_angle = -7.0 + i % 24;
        p.turns = 0.05 + 0.2 * (i % 6);
        p.frequency = i % 4 < 2 ? 0.01 : -0.01;
        double expected = INFINITY;
        const int count = 20000;
        for (int k = 0; k <= count; k++) {
            const double swept = 2.0 * pi * p.turns * k / count;
            const double angle = p.start_angle + (p.frequency < 0.0 ? -swept : swept);
            const double x = p.center[0] + p.radius * cos(angle);
            const double y = p.center[1] + p.radius * sin(angle);
            expected = fmin(expected, sqrt(x * x + y * y));
        }
        double nearest[2];
        const double distance = rp_trajectory_distance(&p, nearest);
        TEST_ASSERT_DOUBLE_WITHIN(1e-7, expected, distance);
        TEST_ASSERT_DOUBLE_WITHIN(1e-14, distance,
                                  sqrt(nearest[0] * nearest[0] + nearest[1] * nearest[1]));
    }
}

static void test_what_belongs_to_another_motion_is_not_checked(void) {
    p.frequency = 0.0;
    p.ramp_time = 1e9;
    p.motion = RP_TRAJECTORY_LINE;
    TEST_ASSERT_EQUAL_INT(RP_TRAJECTORY_VALID, rp_trajectory_check(&p));
    p.ee_from[0] = p.ee_from[1] = 0.0;
    TEST_ASSERT_EQUAL_INT(RP_TRAJECTORY_OUT_OF_REACH, rp_trajectory_check(&p));
    p.motion = RP_TRAJECTORY_POINT_TO_POINT;
    TEST_ASSERT_EQUAL_INT(RP_TRAJECTORY_VALID, rp_trajectory_check(&p));
}

/* ---- A model without states ------------------------------------------------------------------ */

static void test_arrays_of_no_states(void) {
    const struct instance_experiment experiment = {.start_time = 0.0};
    struct instance *instance;
    ASSERT_OK(instance_create(&model_description, &last_text_sink, &instance));
    ASSERT_OK(instance_setup_experiment(instance, &experiment));
    ASSERT_OK(instance_enter_initialization(instance));
    ASSERT_OK(instance_exit_initialization(instance));
    TEST_ASSERT_EQUAL_UINT64(0, instance_state_count(instance));
    ASSERT_OK(instance_set_states(instance, NULL, 0));
    ASSERT_OK(instance_get_states(instance, NULL, 0));
    ASSERT_OK(instance_get_derivatives(instance, NULL, 0));
    ASSERT_OK(instance_get_nominals(instance, NULL, 0));
    double x = 0.0;
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT, instance_get_states(instance, &x, 1));
    instance_destroy(instance);
}
