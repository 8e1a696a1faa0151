/* The reference motions at their ends, distances of paths, and a model without states. Outputs and
 * their derivatives are compared with 40 digits in test_trajectory.py. */
#include "continuous_states.h"
#include "instance.h"
#include "last_text.h"
#include "model_description.h"
#include "rp_trajectory.h"

#include <math.h>
#include <unity.h>

static const double pi = 3.14159265358979323846;
static struct rp_trajectory_parameters p;

/* All parameters have a value, though only those of one motion count. The circle has the
 * start values of rp_trajectory.toml, beside the axis of joint 1. */
static const struct rp_trajectory_parameters example = {
    .motion = RP_TRAJECTORY_MOTION_CIRCLE,
    .branch = RP_TRAJECTORY_BRANCH_FORWARD,
    .l1 = 0.5,
    .a = 0.1,
    .start_time = 0.5,
    .duration = 1.25,
    .q1_from = 0.2,
    .q2_from = -0.1,
    .q1_to = -1.0,
    .q2_to = 0.3,
    .ee_x_from = -0.5,
    .ee_y_from = 0.2,
    .ee_x_to = -0.3,
    .ee_y_to = -0.35,
    .x_center = 0.4,
    .y_center = 0.1,
    .radius = 0.1,
    .frequency = 0.5,
    .turns = 2.0,
    .ramp_time = 1.0,
};

void setUp(void) {
    p = example;
    last_text[0] = '\0';
}

/* The circle that contains the axis of joint 1. */
static void set_around(void) {
    p.x_center = 0.05;
    p.y_center = -0.1;
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
    return p.motion == RP_TRAJECTORY_MOTION_CIRCLE
               ? p.start_time + p.turns / fabs(p.frequency) + p.ramp_time
               : p.start_time + p.duration;
}

/* ---- Geometry ------------------------------------------------------------------------------- */

/* Near an end the way that is left has all its digits: s(x) = 10 x^3 - 15 x^4 + 6 x^5 of 1e-10. */
static void test_small_ways_near_an_end_keep_their_digits(void) {
    const double duration = 100.0;
    const double x = 0.02 / duration;
    const double s = x * x * x * (10.0 + x * (-15.0 + x * 6.0));
    p.motion = RP_TRAJECTORY_MOTION_POINT_TO_POINT;
    p.start_time = 0.0;
    p.duration = duration;
    p.q1_from = 0.0;
    p.q1_to = 1.0;
    const double first = at(0.02).q[0].position;
    TEST_ASSERT_DOUBLE_WITHIN(1e-12 * s, s, first);
    p.q1_from = -1.0;
    p.q1_to = 0.0;
    const double last = at(duration - 0.02).q[0].position;
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * s, -s, last);
}

static void test_ends_are_reached_exactly(void) {
    p.motion = RP_TRAJECTORY_MOTION_POINT_TO_POINT;
    TEST_ASSERT_TRUE(at(p.start_time).q[0].position == p.q1_from);
    TEST_ASSERT_TRUE(at(p.start_time).q[1].position == p.q2_from);
    TEST_ASSERT_TRUE(at(end_time()).q[0].position == p.q1_to);
    TEST_ASSERT_TRUE(at(end_time()).q[1].position == p.q2_to);
    p.motion = RP_TRAJECTORY_MOTION_LINE;
    TEST_ASSERT_TRUE(at(p.start_time).ee[0].position == p.ee_x_from);
    TEST_ASSERT_TRUE(at(p.start_time).ee[1].position == p.ee_y_from);
    TEST_ASSERT_TRUE(at(end_time()).ee[0].position == p.ee_x_to);
    TEST_ASSERT_TRUE(at(end_time()).ee[1].position == p.ee_y_to);
    p.motion = RP_TRAJECTORY_MOTION_CIRCLE;
    p.turns = 2.25;
    TEST_ASSERT_DOUBLE_WITHIN(2e-16, p.x_center, at(end_time()).ee[0].position);
    TEST_ASSERT_DOUBLE_WITHIN(2e-16, p.y_center + p.radius, at(end_time()).ee[1].position);
}

/* ---- Reachability --------------------------------------------------------------------------- */

static void test_distance_of_a_line(void) {
    p.ee_x_from = -1.0;
    p.ee_x_to = 2.0;
    p.ee_y_from = p.ee_y_to = 0.25;
    TEST_ASSERT_DOUBLE_WITHIN(1e-16, 0.25, nearest_of_line(&p).distance);
    TEST_ASSERT_DOUBLE_WITHIN(1e-16, 0.0, nearest_of_line(&p).x);
    p.ee_x_to = -0.3; // ends before the foot of the perpendicular
    p.ee_y_to = 0.4;
    TEST_ASSERT_DOUBLE_WITHIN(1e-16, 0.5, nearest_of_line(&p).distance);
    TEST_ASSERT_TRUE(nearest_of_line(&p).x == -0.3 && nearest_of_line(&p).y == 0.4);
    p.ee_x_from = p.ee_x_to; // a line of no length
    p.ee_y_from = p.ee_y_to;
    TEST_ASSERT_DOUBLE_WITHIN(1e-16, 0.5, nearest_of_line(&p).distance);
}

/* Against the nearest of many points of the swept arc. */
static void test_distance_of_an_arc(void) {
    for (int i = 0; i < 12 * 6 * 2; i++) {
        p = example;
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
            const double x = p.x_center + p.radius * cos(angle);
            const double y = p.y_center + p.radius * sin(angle);
            expected = fmin(expected, sqrt(x * x + y * y));
        }
        const struct near_point nearest = nearest_of_circle(&p);
        TEST_ASSERT_DOUBLE_WITHIN(1e-7, expected, nearest.distance);
        TEST_ASSERT_DOUBLE_WITHIN(1e-14, nearest.distance,
                                  sqrt(nearest.x * nearest.x + nearest.y * nearest.y));
    }
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
