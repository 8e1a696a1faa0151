/* Kinematics against positions written down from the figure of the notes. */
#include "rp_equations.h"
#include "rp_test_support.h"
#include "unity.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define EPS DBL_EPSILON

static struct rp_test_random random_source;
static struct rp_parameters p;
static struct rp_test_state s;

void setUp(void) {
    random_source.state = 11;
}
static void next_sample(void) {
    rp_test_random_parameters(&random_source, &p);
    rp_test_random_state(&random_source, &s);
}

/* The arm in this state, until the next call. */
static const struct arm *arm_at(const double q[2], const double dq[2]) {
    static struct arm arm;
    arm = arm_in_state(&p, q, dq);
    return &arm;
}

/* Bound of the distances that add up to the reach of the arm. */
static double reach(void) {
    return p.l1 + p.lc1 + fabs(s.q[1]) + fabs(p.a);
}

/* l1 + q2 along z1 and a across it, along x1, from the joint axis. */
static void end_effector(const double q[2], double position[2]) {
    position[0] = (p.l1 + q[1]) * cos(q[0]) - p.a * sin(q[0]);
    position[1] = (p.l1 + q[1]) * sin(q[0]) + p.a * cos(q[0]);
}

/* ---- Jacobians ------------------------------------------------------------------------------ */

static void test_angular_jacobian_turns_about_z0(void) {
    double J[3][2];
    memset(J, 0xff, sizeof J);
    arm_angular_jacobian(J);
    for (int i = 0; i < 3; ++i) {
        TEST_ASSERT_TRUE(J[i][0] == (i == 2 ? 1.0 : 0.0));
        TEST_ASSERT_TRUE(J[i][1] == 0.0);
    }
}

static void test_linear_jacobians_are_3(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double J1[2][2], J2[2][2], s1, c1;
        next_sample();
        s1 = sin(s.q[0]);
        c1 = cos(s.q[0]);
        arm_link1_jacobian(arm_at(s.q, s.dq), J1);
        arm_end_effector_jacobian(arm_at(s.q, s.dq), J2);
        double bound = 4 * EPS * reach();
        ASSERT_CLOSE(-p.lc1 * s1, J1[0][0], bound);
        ASSERT_CLOSE(p.lc1 * c1, J1[1][0], bound);
        ASSERT_CLOSE(-p.l1 * s1 - p.a * c1 - s.q[1] * s1, J2[0][0], bound);
        ASSERT_CLOSE(p.l1 * c1 - p.a * s1 + s.q[1] * c1, J2[1][0], bound);
        TEST_ASSERT_TRUE(J1[0][1] == 0.0 && J1[1][1] == 0.0);
        ASSERT_CLOSE(c1, J2[0][1], EPS);
        ASSERT_CLOSE(s1, J2[1][1], EPS);
    }
}

/* ---- End effector --------------------------------------------------------------------------- */

static void test_end_effector_position_is_that_of_frame_2(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double position[2], expected[2];
        next_sample();
        arm_end_effector_position(arm_at(s.q, s.dq), position);
        end_effector(s.q, expected);
        ASSERT_CLOSE(expected[0], position[0], 4 * EPS * reach());
        ASSERT_CLOSE(expected[1], position[1], 4 * EPS * reach());
    }
    /* link 1 to the right and then upward: the offset a lies to the left of the slide */
    rp_test_default_parameters(&p);
    double position[2];
    arm_end_effector_position(arm_at((double[2]){0.0, 0.25}, s.dq), position);
    ASSERT_CLOSE(0.75, position[0], EPS);
    ASSERT_CLOSE(0.1, position[1], EPS);
    arm_end_effector_position(arm_at((double[2]){0.5 * RP_TEST_PI, 0.25}, s.dq), position);
    ASSERT_CLOSE(-0.1, position[0], EPS);
    ASSERT_CLOSE(0.75, position[1], EPS);
}

static void test_end_effector_velocity_is_that_of_the_jacobian(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double velocity[2], J[2][2];
        next_sample();
        arm_end_effector_velocity(arm_at(s.q, s.dq), velocity);
        arm_end_effector_jacobian(arm_at(s.q, s.dq), J);
        double bound = 8 * EPS * (reach() * fmax(1.0, fabs(s.dq[0])) + fabs(s.dq[1]));
        for (int axis = 0; axis < 2; ++axis) {
            double product = J[axis][0] * s.dq[0] + J[axis][1] * s.dq[1];
            ASSERT_CLOSE(product, velocity[axis], bound);
        }
    }
}
