/* Equations of the notes that no FMU shows, by their definitions, and the two formulations, one by
 * the other. tests/fmi2/test_unit.py compares all that the FMU shows with sympy. */
#include "rp_recursion.h"
#include "rp_test_support.h"
#include "unity.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define EPS DBL_EPSILON

static struct rp_test_random random_source;
static struct arm_parameters p;
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
        double J1[2][2], J2[2][2];
        next_sample();
        memset(J1, 0xff, sizeof J1);
        memset(J2, 0xff, sizeof J2);
        arm_link1_jacobian(arm_at(s.q, s.dq), J1);
        arm_end_effector_jacobian(arm_at(s.q, s.dq), J2);
        double bound = 4 * EPS * (p.l1 + p.lc1 + fabs(q2) + fabs(p.a));
        ASSERT_CLOSE(-p.lc1 * s1, J1[0][0], bound);
        ASSERT_CLOSE(p.lc1 * c1, J1[1][0], bound);
        ASSERT_CLOSE(-p.l1 * s1 - p.a * c1 - q2 * s1, J2[0][0], bound);
        ASSERT_CLOSE(p.l1 * c1 - p.a * s1 + q2 * c1, J2[1][0], bound);
        TEST_ASSERT_TRUE(J1[0][1] == 0.0 && J1[1][1] == 0.0);
        ASSERT_CLOSE(c1, J2[0][1], EPS);
        ASSERT_CLOSE(s1, J2[1][1], EPS);
    }
}

/* ---- Mass matrix, Christoffel symbols, Coriolis matrix -------------------------------------- */

static double longest_L(double slide) {
    return p.l1 + fabs(slide);
}

/* Bound of d11 and of the terms it consists of, for |q2| <= q2_bound. */
static double d11_scale(double q2_bound) {
    return rp_test_inertia(&p, fabs(q2_bound)) + p.m2 * p.a * p.a;
}

/* Central differences of eighth order, exact for polynomials up to degree 8; rounding errs by 2.1
 * times the error of f, by h. */
static double derivative(double (*f)(const void *context, double x), const void *context, double x,
                         double h) {
    static const double weights[4] = {4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0};
    double sum = 0.0;
    for (int k = 4; k >= 1; --k) {
        sum += weights[k - 1] * (f(context, x + k * h) - f(context, x - k * h));
    }
    return sum / h;
}

/* D[row][column] at q + t direction. */
struct mass_matrix_path {
    int row;
    int column;
    double direction[2];
};

static double mass_matrix_on_path(const void *context, double t) {
    const struct mass_matrix_path *path = context;
    double q[2] = {s.q[0] + t * path->direction[0], s.q[1] + t * path->direction[1]}, D[2][2];
    arm_mass_matrix(arm_at(q, s.dq), D);
    return D[path->row][path->column];
}

/* d D[row][column] / d q[k]; D is quadratic in q2, so that any step is exact but for rounding. */
static double mass_matrix_derivative(int row, int column, int k) {
    struct mass_matrix_path path = {row, column, {k == 0, k == 1}};
    return derivative(mass_matrix_on_path, &path, 0.0, 1.0);
}

static void test_christoffel_symbols_are_their_definition(void) {
    for (int n = 0; n < RP_TEST_SAMPLES / 10; ++n) {
        double c[2][2][2];
        next_sample();
        memset(c, 0xff, sizeof c); /* NaN: each is written */
        arm_christoffel(arm_at(s.q, s.dq), c);
        double bound = 32 * EPS * d11_scale(fabs(s.q[1]) + 4.0);
        for (int i = 0; i < 2; ++i) {
            for (int j = 0; j < 2; ++j) {
                TEST_ASSERT_TRUE(c[i][j][0] == c[j][i][0] && c[i][j][1] == c[j][i][1]);
                for (int k = 0; k < 2; ++k) {
                    double expected =
                        0.5 * (mass_matrix_derivative(k, j, i) + mass_matrix_derivative(k, i, j) -
                               mass_matrix_derivative(i, j, k));
                    ASSERT_CLOSE(expected, c[i][j][k], bound);
                }
            }
        }
        /* the two that are not zero, as (9) prints them */
        bound = 4 * EPS * p.m2 * longest_L(s.q[1]);
        ASSERT_CLOSE(p.l1 * p.m2 + p.m2 * s.q[1], c[0][1][0], bound);
        ASSERT_CLOSE(-p.l1 * p.m2 - p.m2 * s.q[1], c[0][0][1], bound);
    }
}

static void test_mass_matrix_rate_less_twice_coriolis_is_skew(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double C[2][2], N[2][2];
        next_sample();
        arm_coriolis_matrix(arm_at(s.q, s.dq), C);
        for (int i = 0; i < 2; ++i) {
            for (int j = 0; j < 2; ++j) {
                struct mass_matrix_path path = {i, j, {s.dq[0], s.dq[1]}};
                double rate = derivative(mass_matrix_on_path, &path, 0.0, 0.25);
                N[i][j] = rate - 2.0 * C[i][j];
            }
        }
        /* 2.1 times the rounding of D by the step 1/4, and the rounding of C */
        double bound = 64 * EPS * d11_scale(fabs(s.q[1]) + fabs(s.dq[1]));
        bound += 8 * EPS * p.m2 * longest_L(s.q[1]) * (fabs(s.dq[0]) + fabs(s.dq[1]));
        ASSERT_CLOSE(0.0, N[0][0], bound);
        ASSERT_CLOSE(0.0, N[0][1] + N[1][0], bound);
        ASSERT_CLOSE(0.0, N[1][1], bound);
    }
}

/* ---- Newton-Euler recursion ----------------------------------------------------------------- */

/* Loads of the joints in the sample. */
static struct joint_loads find_loads(void) {
    return loads_of_motion(arm_at(s.q, s.dq), s.tau, s.ddq);
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

/* (20) and (22) to (25) with `coriolis` times q1' q2': 2 is right, the notes print 1. */
static struct joint_loads loads_as_printed(double coriolis) {
    double f2x = p.m2 * (L * ddq1 - p.a * dq1 * dq1 + coriolis * dq1 * dq2 + p.g * c1);
    double f2z = p.m2 * (-p.a * ddq1 - L * dq1 * dq1 + ddq2 + p.g * s1);
    double f1x = f2x + p.m1 * (p.lc1 * ddq1 + p.g * c1);
    double f1z = f2z + p.m1 * (-p.lc1 * dq1 * dq1 + p.g * s1);
    double tau2 =
        p.m2 * (q2 * L * ddq1 - q2 * p.a * dq1 * dq1 + coriolis * q2 * dq1 * dq2 + q2 * p.g * c1) +
        p.I2z * ddq1;
    double tau1 = tau2 + p.lc1 * f1x - (p.lc1 - p.l1) * f2x - p.a * f2z + p.I1z * ddq1;
    return (struct joint_loads){.f1 = {f1x, 0.0, f1z},
                                .tau1 = {0.0, tau1, 0.0},
                                .f2 = {f2x, 0.0, f2z},
                                .tau2 = {0.0, tau2, 0.0}};
}

static void test_joint_loads_are_19_to_25(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        next_sample();
        const struct joint_loads loads = find_loads(), expected = loads_as_printed(2.0);
        double force = 16 * EPS * force_scale(), moment = 16 * EPS * moment_scale();
        ASSERT_VECTOR(expected.f1.x, 0.0, expected.f1.z, OF(loads.f1), force);
        ASSERT_VECTOR(expected.f2.x, 0.0, expected.f2.z, OF(loads.f2), force);
        ASSERT_VECTOR(0.0, expected.tau1.y, 0.0, OF(loads.tau1), moment);
        ASSERT_VECTOR(0.0, expected.tau2.y, 0.0, OF(loads.tau2), moment);
    }
}

/* ---- Newton-Euler against Euler-Lagrange ---------------------------------------------------- */

/* Bounds of the terms of (14) and (15), for any q1. */
static void find_effort_scale(double scale[2]) {
    const double a = fabs(p.a), g = fabs(p.g), reach = longest_L(q2);
    const double coriolis = 2.0 * p.m2 * reach * fabs(dq1 * dq2);
    scale[0] = d11_scale(q2) * fabs(ddq1) + p.m2 * a * fabs(ddq2) + coriolis +
               g * (p.m1 * p.lc1 + p.m2 * (reach + a));
    scale[1] = p.m2 * (a * fabs(ddq1) + fabs(ddq2) + reach * dq1 * dq1 + g);
}

static void test_newton_euler_gives_the_generalized_forces_of_euler_lagrange(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double tau[2], scale[2];
        next_sample();
        const struct joint_loads loads = find_loads();
        arm_inverse_dynamics(arm_at(s.q, s.dq), s.ddq, tau);
        find_effort_scale(scale);
        ASSERT_CLOSE(tau[0], loads.tau1.y,
                     fmin(16 * EPS * (moment_scale() + scale[0]), 1e-12 * scale[0]));
        ASSERT_CLOSE(tau[1], loads.f2.z, 16 * EPS * scale[1]);
    }
}

/* (18) as printed has half of the Coriolis acceleration. The missing half turns up in (26), which
 * is then short of (14) by m2 (l1 + q2) q1' q2'; (27) does not contain it. */
static void test_recursion_as_printed_is_short_of_14(void) {
    double largest = 0.0;
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double tau[2], scale[2];
        next_sample();
        const struct joint_loads printed = loads_as_printed(1.0);
        arm_inverse_dynamics(arm_at(s.q, s.dq), s.ddq, tau);
        find_effort_scale(scale);
        double missing = p.m2 * L * dq1 * dq2;
        double bound = 16 * EPS * (moment_scale() + scale[0]);
        ASSERT_CLOSE(-missing, printed.tau1.y - tau[0], bound);
        ASSERT_CLOSE(tau[1], printed.f2.z, 16 * EPS * scale[1]);
        largest = fmax(largest, fabs(missing) / bound);
    }
    TEST_ASSERT_TRUE(largest > 1e9); /* far above the rounding */
}
