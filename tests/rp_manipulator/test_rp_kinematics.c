/* Kinematics against positions written down from the figure and the table of the notes. */
#include "rp_manipulator.h"
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
    rp_jacobian_angular(J);
    for (int i = 0; i < 3; ++i) {
        TEST_ASSERT_TRUE(J[i][0] == (i == 2 ? 1.0 : 0.0));
        TEST_ASSERT_TRUE(J[i][1] == 0.0);
    }
}

static void test_linear_jacobians_are_3(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double J1[3][2], J2[3][2], s1, c1;
        next_sample();
        s1 = sin(s.q[0]);
        c1 = cos(s.q[0]);
        rp_jacobian_linear_link1(&p, s.q, J1);
        rp_jacobian_linear_link2(&p, s.q, J2);
        double bound = 4 * EPS * reach();
        ASSERT_CLOSE(-p.lc1 * s1, J1[0][0], bound);
        ASSERT_CLOSE(p.lc1 * c1, J1[1][0], bound);
        ASSERT_CLOSE(-p.l1 * s1 - p.a * c1 - s.q[1] * s1, J2[0][0], bound);
        ASSERT_CLOSE(p.l1 * c1 - p.a * s1 + s.q[1] * c1, J2[1][0], bound);
        TEST_ASSERT_TRUE(J1[0][1] == 0.0 && J1[1][1] == 0.0);
        TEST_ASSERT_TRUE(J1[2][0] == 0.0 && J1[2][1] == 0.0);
        TEST_ASSERT_TRUE(J2[2][0] == 0.0 && J2[2][1] == 0.0);
        ASSERT_CLOSE(c1, J2[0][1], EPS);
        ASSERT_CLOSE(s1, J2[1][1], EPS);
    }
}

/* ---- Denavit-Hartenberg frames -------------------------------------------------------------- */

static void test_dh_table_is_that_of_the_notes(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        struct rp_dh_row rows[2];
        next_sample();
        memset(rows, 0xff, sizeof rows);
        rp_dh_table(&p, s.q, rows);
        TEST_ASSERT_TRUE(rows[0].a == p.a && rows[0].d == 0.0);
        TEST_ASSERT_TRUE(rows[0].alpha == 0.5 * RP_TEST_PI);
        ASSERT_CLOSE(0.5 * RP_TEST_PI + s.q[0], rows[0].theta, EPS * 8.0);
        TEST_ASSERT_TRUE(rows[1].a == 0.0 && rows[1].alpha == 0.0 && rows[1].theta == 0.0);
        TEST_ASSERT_TRUE(rows[1].d == p.l1 + s.q[1]);
    }
}

static void multiply(double A[4][4], double B[4][4], double product[4][4]) {
    for (int i = 0; i < 4; ++i) {
        for (int j = 0; j < 4; ++j) {
            product[i][j] = 0.0;
            for (int k = 0; k < 4; ++k) {
                product[i][j] += A[i][k] * B[k][j];
            }
        }
    }
}

static void test_dh_transform_is_the_product_of_its_four_motions(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        struct rp_dh_row row = {.a = rp_test_uniform(&random_source, -2.0, 2.0),
                                .alpha = rp_test_uniform(&random_source, -3.2, 3.2),
                                .d = rp_test_uniform(&random_source, -2.0, 2.0),
                                .theta = rp_test_uniform(&random_source, -3.2, 3.2)};
        double ct = cos(row.theta), st = sin(row.theta), ca = cos(row.alpha), sa = sin(row.alpha);
        double turn_z[4][4] = {{ct, -st, 0, 0}, {st, ct, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
        double shift[4][4] = {{1, 0, 0, row.a}, {0, 1, 0, 0}, {0, 0, 1, row.d}, {0, 0, 0, 1}};
        double turn_x[4][4] = {{1, 0, 0, 0}, {0, ca, -sa, 0}, {0, sa, ca, 0}, {0, 0, 0, 1}};
        double A[4][4], expected[4][4], first[4][4];
        multiply(turn_z, shift, first);
        multiply(first, turn_x, expected);
        rp_dh_transform(&row, A);
        for (int i = 0; i < 4; ++i) {
            for (int j = 0; j < 4; ++j) {
                ASSERT_CLOSE(expected[i][j], A[i][j], 4 * EPS * (j == 3 ? 2.0 : 1.0));
            }
        }
    }
}

static void test_forward_kinematics_is_the_pose_in_the_figure(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double T[4][4], position[2];
        next_sample();
        rp_forward_kinematics(&p, s.q, T);
        end_effector(s.q, position);
        /* x2 = x1, y2 = z0, z2 = z1; theta of the table rounds pi/2 + q1 */
        double s1 = sin(s.q[0]), c1 = cos(s.q[0]), length = reach();
        double pose[4][4] = {{-s1, 0.0, c1, position[0]},
                             {c1, 0.0, s1, position[1]},
                             {0.0, 1.0, 0.0, 0.0},
                             {0.0, 0.0, 0.0, 1.0}};
        for (int i = 0; i < 4; ++i) {
            for (int j = 0; j < 4; ++j) {
                ASSERT_CLOSE(pose[i][j], T[i][j], 8 * EPS * (j == 3 ? length : 1.0));
            }
            TEST_ASSERT_TRUE(T[3][i] == (i == 3 ? 1.0 : 0.0));
        }
    }
}

/* ---- End effector --------------------------------------------------------------------------- */

static void test_end_effector_position_is_that_of_frame_2(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double position[2], expected[2];
        next_sample();
        rp_end_effector_position(&p, s.q, position);
        end_effector(s.q, expected);
        ASSERT_CLOSE(expected[0], position[0], 4 * EPS * reach());
        ASSERT_CLOSE(expected[1], position[1], 4 * EPS * reach());
    }
    /* link 1 to the right and then upward: the offset a lies to the left of the slide */
    rp_test_default_parameters(&p);
    double position[2];
    rp_end_effector_position(&p, (double[2]){0.0, 0.25}, position);
    ASSERT_CLOSE(0.75, position[0], EPS);
    ASSERT_CLOSE(0.1, position[1], EPS);
    rp_end_effector_position(&p, (double[2]){0.5 * RP_TEST_PI, 0.25}, position);
    ASSERT_CLOSE(-0.1, position[0], EPS);
    ASSERT_CLOSE(0.75, position[1], EPS);
}

static void test_end_effector_velocity_is_that_of_the_jacobian(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double velocity[2], J[3][2];
        next_sample();
        rp_end_effector_velocity(&p, s.q, s.dq, velocity);
        rp_jacobian_linear_link2(&p, s.q, J);
        double bound = 8 * EPS * (reach() * fmax(1.0, fabs(s.dq[0])) + fabs(s.dq[1]));
        for (int axis = 0; axis < 2; ++axis) {
            double product = J[axis][0] * s.dq[0] + J[axis][1] * s.dq[1];
            ASSERT_CLOSE(product, velocity[axis], bound);
        }
    }
}

/* ---- Inverse kinematics --------------------------------------------------------------------- */

static bool within_range(const double q[2]) {
    return q[0] > -RP_TEST_PI && q[0] <= RP_TEST_PI && isfinite(q[1]);
}

static void test_inverse_kinematics_gives_back_the_joint_variables(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double position[2], q[2];
        next_sample();
        double L = p.l1 + s.q[1];
        end_effector(s.q, position);
        TEST_ASSERT_TRUE(fabs(L) > 1e-3); /* holds for the seed; L = 0 has its own test */
        enum rp_branch branch = L > 0.0 ? RP_BRANCH_FORWARD : RP_BRANCH_BACKWARD;
        TEST_ASSERT_TRUE(rp_inverse_kinematics(&p, position, branch, q));
        TEST_ASSERT_TRUE(within_range(q));
        /* r^2 - a^2 loses r / L of its digits; the rounding of q1 up to 3.2 counts too */
        double length = reach(), loss = length / fabs(L);
        ASSERT_CLOSE(0.0, remainder(q[0] - s.q[0], 2.0 * RP_TEST_PI), 16 * EPS * loss);
        ASSERT_CLOSE(s.q[1], q[1], 16 * EPS * length * loss);
    }
}

/* Takes targets to the joint variables of both branches and back. */
static void check_round_trip(const double target[2]) {
    for (int branch = RP_BRANCH_FORWARD; branch <= RP_BRANCH_BACKWARD; ++branch) {
        double q[2], position[2], r = hypot(target[0], target[1]);
        TEST_ASSERT_TRUE(rp_inverse_kinematics(&p, target, (enum rp_branch)branch, q));
        TEST_ASSERT_TRUE(within_range(q));
        end_effector(q, position);
        double L = p.l1 + q[1], bound = 16 * EPS * (r + p.l1 + fabs(p.a));
        TEST_ASSERT_TRUE(branch == RP_BRANCH_FORWARD ? L >= -bound : L <= bound);
        ASSERT_CLOSE(target[0], position[0], bound);
        ASSERT_CLOSE(target[1], position[1], bound);
    }
}

static void test_inverse_kinematics_reaches_the_target_on_both_branches(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double target[2];
        next_sample();
        /* distances from |a| on, some of them close to it */
        double distance = fabs(p.a) * (1.0 + ldexp(fabs(s.q[1]), -(n % 24))) + 1e-12;
        double angle = s.q[0];
        target[0] = distance * cos(angle);
        target[1] = distance * sin(angle);
        check_round_trip(target);
    }
}

/* Axes and diagonals, where angles wrap: among them atan2(-0, -1) = -pi, outside (-pi, pi]. */
static void test_inverse_kinematics_keeps_q1_in_range_on_the_axes(void) {
    static const double offsets[5] = {0.0, -0.0, 1.0, -1.0, 1e-9};
    static const double values[5] = {0.0, -0.0, 3.0, -3.0, 1e-20};
    rp_test_default_parameters(&p);
    for (int n = 0; n < 125; ++n) {
        double target[2] = {values[n % 5], values[n / 5 % 5]};
        p.a = offsets[n / 25];
        if (hypot(target[0], target[1]) > fabs(p.a)) {
            check_round_trip(target);
        }
    }
}

static void test_inverse_kinematics_at_the_smallest_distance(void) {
    rp_test_default_parameters(&p);
    for (int sign = -1; sign <= 1; sign += 2) {
        for (int branch = RP_BRANCH_FORWARD; branch <= RP_BRANCH_BACKWARD; ++branch) {
            double q[2];
            p.a = 5.0 * sign; /* 3, 4, 5: the distance is exact */
            TEST_ASSERT_TRUE(
                rp_inverse_kinematics(&p, (double[2]){3.0, 4.0}, (enum rp_branch)branch, q));
            TEST_ASSERT_TRUE(p.l1 + q[1] == 0.0);
            ASSERT_CLOSE(-0.6 * sign, sin(q[0]), 4 * EPS);
            ASSERT_CLOSE(0.8 * sign, cos(q[0]), 4 * EPS);
        }
    }
}

static void test_inverse_kinematics_of_the_origin(void) {
    rp_test_default_parameters(&p);
    p.a = 0.0;
    for (int branch = RP_BRANCH_FORWARD; branch <= RP_BRANCH_BACKWARD; ++branch) {
        double q[2] = {7.0, 7.0};
        TEST_ASSERT_TRUE(
            rp_inverse_kinematics(&p, (double[2]){0.0, 0.0}, (enum rp_branch)branch, q));
        TEST_ASSERT_TRUE(q[0] == 0.0 && q[1] == -p.l1);
    }
}

static void test_inverse_kinematics_over_the_whole_range_of_double(void) {
    double q[2];
    rp_test_default_parameters(&p);
    TEST_ASSERT_TRUE(rp_inverse_kinematics(&p, (double[2]){3e200, 4e200}, RP_BRANCH_FORWARD, q));
    ASSERT_CLOSE(5e200, q[1], 4 * EPS * 5e200);
    ASSERT_CLOSE(0.6, cos(q[0]), 4 * EPS);
    p.a = p.l1 = 0.0;
    TEST_ASSERT_TRUE(rp_inverse_kinematics(&p, (double[2]){3e-200, 4e-200}, RP_BRANCH_FORWARD, q));
    ASSERT_CLOSE(5e-200, q[1], 4 * EPS * 5e-200);
}

static void expect_refused(double x, double y) {
    for (int branch = RP_BRANCH_FORWARD; branch <= RP_BRANCH_BACKWARD; ++branch) {
        double q[2] = {7.0, -8.0};
        TEST_ASSERT_FALSE(rp_inverse_kinematics(&p, (double[2]){x, y}, (enum rp_branch)branch, q));
        TEST_ASSERT_TRUE(q[0] == 7.0 && q[1] == -8.0);
    }
}

static void test_inverse_kinematics_refuses_what_it_cannot_reach(void) {
    rp_test_default_parameters(&p);
    for (int sign = -1; sign <= 1; sign += 2) {
        p.a = 5.0 * sign;
        expect_refused(0.0, 0.0);
        expect_refused(3.0, 3.9);
        expect_refused(0.0, nextafter(5.0, 0.0)); /* the last double inside */
        check_round_trip((double[2]){0.0, 5.0});
        check_round_trip((double[2]){0.0, nextafter(5.0, 6.0)});
    }
    static const double bad[3] = {NAN, INFINITY, -INFINITY};
    for (int i = 0; i < 3; ++i) {
        expect_refused(bad[i], 6.0);
        expect_refused(6.0, bad[i]);
        expect_refused(bad[i], INFINITY); /* hypot(NAN, INFINITY) is INFINITY */
    }
    expect_refused(DBL_MAX, DBL_MAX); /* finite, but its distance is not */
}
