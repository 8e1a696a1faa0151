/* Newton-Euler recursion against the closed forms of the notes, with (18) corrected, and against
 * the Euler-Lagrange dynamics. */
#include "rp_recursion.h"
#include "rp_test_support.h"
#include "unity.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define EPS DBL_EPSILON

static struct rp_test_random random_source;
static struct rp_parameters p;
static struct rp_test_state s;

/* Short names of the notes for the sample, set by next_sample. */
static double s1, c1, q2, L, dq1, dq2, ddq1, ddq2;

void setUp(void) {
    random_source.state = 13;
}
static void next_sample(void) {
    rp_test_random_parameters(&random_source, &p);
    rp_test_random_state(&random_source, &s);
    s1 = sin(s.q[0]);
    c1 = cos(s.q[0]);
    q2 = s.q[1];
    L = p.l1 + q2;
    dq1 = s.dq[0];
    dq2 = s.dq[1];
    ddq1 = s.ddq[0];
    ddq2 = s.ddq[1];
}

/* The arm in this state, until the next call. */
static const struct arm *arm_at(const double q[2], const double dq[2]) {
    static struct arm arm;
    arm = arm_in_state(&p, q, dq);
    return &arm;
}

/* Loads of the joints in the sample. */
static void find_loads(struct rp_joint_loads *loads) {
    const struct joint_loads found = loads_of_motion(arm_at(s.q, s.dq), s.tau, s.ddq);
    write_loads(&found, loads);
}

/* Bound of the terms of the accelerations of both links, and of the forces on them. */
static double acceleration_scale(void) {
    double length = p.l1 + p.lc1 + fabs(q2) + fabs(p.a);
    return length * (fabs(ddq1) + dq1 * dq1) + 2.0 * fabs(dq1 * dq2) + fabs(ddq2);
}

static double force_scale(void) {
    return (p.m1 + p.m2) * (acceleration_scale() + fabs(p.g));
}

/* The terms of (26) are longer than those of (14): lc1 enters twice, with both signs. */
static double moment_scale(void) {
    double arms = fabs(q2) + 2.0 * p.lc1 + p.l1 + fabs(p.a);
    return arms * force_scale() + (p.I1z + p.I2z) * fabs(ddq1);
}

#define OF(v)                            ((const double[3]){(v).x, (v).y, (v).z})
#define ASSERT_VECTOR(x, y, z, v, bound) vector_close(x, y, z, v, bound, __LINE__)
static void vector_close(double x, double y, double z, const double v[3], double bound, int line) {
    rp_test_close(x, v[0], bound, line);
    rp_test_close(y, v[1], bound, line);
    rp_test_close(z, v[2], bound, line);
}

/* ---- Forward recursion ---------------------------------------------------------------------- */

static void test_link_motion_is_16_to_18(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        next_sample();
        const struct link_motion motion = link_motion(arm_at(s.q, s.dq), s.ddq);
        double bound = 8 * EPS * acceleration_scale();
        ASSERT_VECTOR(0.0, dq1, 0.0, OF(motion.omega), 0.0);
        ASSERT_VECTOR(0.0, ddq1, 0.0, OF(motion.domega), 0.0);
        ASSERT_VECTOR(p.lc1 * ddq1, 0.0, -p.lc1 * dq1 * dq1, OF(motion.ac1), bound);
        ASSERT_VECTOR(p.l1 * ddq1 - p.a * dq1 * dq1, 0.0, -p.a * ddq1 - p.l1 * dq1 * dq1,
                      OF(motion.ae1), bound);
        ASSERT_VECTOR(L * ddq1 - p.a * dq1 * dq1 + 2.0 * dq1 * dq2, 0.0,
                      -p.a * ddq1 - L * dq1 * dq1 + ddq2, OF(motion.ac2), bound);
    }
}

/* ---- Backward recursion --------------------------------------------------------------------- */

/* (20) and (22) to (25) with `coriolis` times q1' q2': 2 is right, the notes print 1. */
static void loads_as_printed(double coriolis, struct rp_joint_loads *loads) {
    double f2x = p.m2 * (L * ddq1 - p.a * dq1 * dq1 + coriolis * dq1 * dq2 + p.g * c1);
    double f2z = p.m2 * (-p.a * ddq1 - L * dq1 * dq1 + ddq2 + p.g * s1);
    double f1x = f2x + p.m1 * (p.lc1 * ddq1 + p.g * c1);
    double f1z = f2z + p.m1 * (-p.lc1 * dq1 * dq1 + p.g * s1);
    double tau2 =
        p.m2 * (q2 * L * ddq1 - q2 * p.a * dq1 * dq1 + coriolis * q2 * dq1 * dq2 + q2 * p.g * c1) +
        p.I2z * ddq1;
    double tau1 = tau2 + p.lc1 * f1x - (p.lc1 - p.l1) * f2x - p.a * f2z + p.I1z * ddq1;
    *loads = (struct rp_joint_loads){.f1 = {f1x, 0.0, f1z},
                                     .tau1 = {0.0, tau1, 0.0},
                                     .f2 = {f2x, 0.0, f2z},
                                     .tau2 = {0.0, tau2, 0.0}};
}

static void test_joint_loads_are_19_to_25(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        struct rp_joint_loads loads, expected;
        next_sample();
        memset(&loads, 0xff, sizeof loads);
        find_loads(&loads);
        loads_as_printed(2.0, &expected);
        double force = 16 * EPS * force_scale(), moment = 16 * EPS * moment_scale();
        ASSERT_VECTOR(expected.f1[0], 0.0, expected.f1[2], loads.f1, force);
        ASSERT_VECTOR(expected.f2[0], 0.0, expected.f2[2], loads.f2, force);
        ASSERT_VECTOR(0.0, expected.tau1[1], 0.0, loads.tau1, moment);
        ASSERT_VECTOR(0.0, expected.tau2[1], 0.0, loads.tau2, moment);
    }
}

/* ---- Newton-Euler against Euler-Lagrange ---------------------------------------------------- */

static void test_newton_euler_gives_the_generalized_forces_of_euler_lagrange(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        struct rp_joint_loads loads;
        double tau[2], scale[2];
        next_sample();
        find_loads(&loads);
        arm_inverse_dynamics(arm_at(s.q, s.dq), s.ddq, tau);
        s.tau[0] = s.tau[1] = 0.0;
        rp_test_force_scale(&p, &s, scale);
        ASSERT_CLOSE(tau[0], loads.tau1[1],
                     fmin(16 * EPS * (moment_scale() + scale[0]), 1e-12 * scale[0]));
        ASSERT_CLOSE(tau[1], loads.f2[2], 16 * EPS * scale[1]);
    }
}

/* (18) as printed has half of the Coriolis acceleration. The missing half turns up in (26), which
 * is then short of (14) by m2 (l1 + q2) q1' q2'; (27) does not contain it. */
static void test_recursion_as_printed_is_short_of_14(void) {
    double largest = 0.0;
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        struct rp_joint_loads printed;
        double tau[2], scale[2];
        next_sample();
        loads_as_printed(1.0, &printed);
        arm_inverse_dynamics(arm_at(s.q, s.dq), s.ddq, tau);
        s.tau[0] = s.tau[1] = 0.0;
        rp_test_force_scale(&p, &s, scale);
        double missing = p.m2 * L * dq1 * dq2;
        double bound = 16 * EPS * (moment_scale() + scale[0]);
        ASSERT_CLOSE(-missing, printed.tau1[1] - tau[0], bound);
        ASSERT_CLOSE(tau[1], printed.f2[2], 16 * EPS * scale[1]);
        largest = fmax(largest, fabs(missing) / bound);
    }
    TEST_ASSERT_TRUE(largest > 1e9); /* far above the rounding */
}
