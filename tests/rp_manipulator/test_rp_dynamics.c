/* Euler-Lagrange dynamics against the notes, numeric derivatives and physics. */
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
    random_source.state = 7;
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

static double longest_L(double q2) {
    return p.l1 + fabs(q2);
}

/* Bound of d11 and of the terms it consists of, for |q2| <= q2_bound. */
static double d11_scale(double q2_bound) {
    return rp_test_inertia(&p, fabs(q2_bound)) + p.m2 * p.a * p.a;
}

static double potential_scale(double q2_bound) {
    return fabs(p.g) * (p.m1 * p.lc1 + p.m2 * (longest_L(q2_bound) + fabs(p.a)));
}

/* ---- Mass matrix, Christoffel symbols, Coriolis matrix -------------------------------------- */

/* (4) from (1)-(3). Only the inertia about the axis out of the page, y1, may count. */
static void mass_matrix_from_jacobians(double D[2][2]) {
    double s1 = sin(s.q[0]), c1 = cos(s.q[0]), q2 = s.q[1];
    double Jv[2][3][2] = {
        {{-p.lc1 * s1, 0.0}, {p.lc1 * c1, 0.0}, {0.0, 0.0}},
        {{-p.l1 * s1 - p.a * c1 - q2 * s1, c1}, {p.l1 * c1 - p.a * s1 + q2 * c1, s1}, {0.0, 0.0}}};
    double Jw[3][2] = {{0.0, 0.0}, {0.0, 0.0}, {1.0, 0.0}};
    double R[3][3] = {{-s1, 0.0, c1}, {c1, 0.0, s1}, {0.0, 1.0, 0.0}};
    double mass[2] = {p.m1, p.m2};
    double inertia[2][3] = {{0.7, p.I1z, 0.3}, {0.2, p.I2z, 0.9}};

    memset(D, 0, sizeof(double[2][2]));
    for (int i = 0; i < 2; ++i) {
        for (int j = 0; j < 2; ++j) {
            for (int link = 0; link < 2; ++link) {
                for (int k = 0; k < 3; ++k) {
                    double wi = R[0][k] * Jw[0][i] + R[1][k] * Jw[1][i] + R[2][k] * Jw[2][i];
                    double wj = R[0][k] * Jw[0][j] + R[1][k] * Jw[1][j] + R[2][k] * Jw[2][j];
                    D[i][j] += mass[link] * Jv[link][k][i] * Jv[link][k][j];
                    D[i][j] += wi * inertia[link][k] * wj;
                }
            }
        }
    }
}

static void test_mass_matrix_is_the_jacobian_form(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double D[2][2], expected[2][2];
        next_sample();
        arm_mass_matrix(arm_at(s.q, s.dq), D);
        mass_matrix_from_jacobians(expected);
        double reach = longest_L(s.q[1]) + fabs(p.a);
        ASSERT_CLOSE(expected[0][0], D[0][0],
                     16 * EPS * (d11_scale(s.q[1]) + p.m2 * reach * reach));
        ASSERT_CLOSE(expected[0][1], D[0][1], 16 * EPS * p.m2 * reach);
        ASSERT_CLOSE(expected[1][0], D[1][0], 16 * EPS * p.m2 * reach);
        ASSERT_CLOSE(expected[1][1], D[1][1], 16 * EPS * p.m2);
    }
}

static void test_mass_matrix_is_symmetric_positive_definite(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double D[2][2];
        next_sample();
        arm_mass_matrix(arm_at(s.q, s.dq), D);
        double det = D[0][0] * D[1][1] - D[0][1] * D[1][0];
        TEST_ASSERT_TRUE(D[0][1] == D[1][0]);
        TEST_ASSERT_TRUE(D[0][0] > 0.0 && det > 0.0);
        ASSERT_CLOSE(p.m2 * rp_test_inertia(&p, s.q[1]), det, 8 * EPS * p.m2 * d11_scale(s.q[1]));
    }
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
    return rp_test_derivative(mass_matrix_on_path, &path, 0.0, 1.0);
}

static void test_christoffel_symbols_are_their_definition(void) {
    for (int n = 0; n < RP_TEST_SAMPLES / 10; ++n) {
        double c[2][2][2];
        next_sample();
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
                double rate = rp_test_derivative(mass_matrix_on_path, &path, 0.0, 0.25);
                N[i][j] = rate - 2.0 * C[i][j];
            }
        }
        /* 2.1 times the rounding of D by the step 1/4, and that of C */
        double bound = 64 * EPS * d11_scale(fabs(s.q[1]) + fabs(s.dq[1]));
        bound += 8 * EPS * p.m2 * longest_L(s.q[1]) * (fabs(s.dq[0]) + fabs(s.dq[1]));
        ASSERT_CLOSE(0.0, N[0][0], bound);
        ASSERT_CLOSE(0.0, N[0][1] + N[1][0], bound);
        ASSERT_CLOSE(0.0, N[1][1], bound);
    }
}

/* ---- Energy and gravity --------------------------------------------------------------------- */

static double potential_energy(const void *context, double x) {
    struct rp_test_state state = s;
    state.q[*(const int *)context] = x;
    return arm_potential_energy(arm_at(state.q, s.dq));
}

static void test_potential_energy_is_weight_times_height(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        next_sample();
        double y1 = p.lc1 * sin(s.q[0]);
        double y2 = (p.l1 + s.q[1]) * sin(s.q[0]) + p.a * cos(s.q[0]);
        ASSERT_CLOSE(p.g * (p.m1 * y1 + p.m2 * y2), arm_potential_energy(arm_at(s.q, s.dq)),
                     8 * EPS * potential_scale(s.q[1]));
    }
}

static void test_gravity_forces_are_the_gradient_of_the_potential(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double forces[2];
        next_sample();
        arm_gravity_forces(arm_at(s.q, s.dq), forces);
        double by_q1 = rp_test_derivative(potential_energy, &(int){0}, s.q[0], 1.0 / 32);
        double by_q2 = rp_test_derivative(potential_energy, &(int){1}, s.q[1], 1.0);
        /* P errs by 4 epsilons, times 2.1 times 32; P is linear in q2 */
        ASSERT_CLOSE(by_q1, forces[0], 512 * EPS * potential_scale(s.q[1]));
        ASSERT_CLOSE(by_q2, forces[1], 16 * EPS * potential_scale(fabs(s.q[1]) + 4.0));
        ASSERT_CLOSE(p.m2 * p.g * sin(s.q[0]), forces[1], 4 * EPS * p.m2 * fabs(p.g));
    }
}

static void test_kinetic_energy_is_that_of_two_moving_bodies(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        next_sample();
        double s1 = sin(s.q[0]), c1 = cos(s.q[0]), L = p.l1 + s.q[1];
        double vx1 = -p.lc1 * s1 * s.dq[0], vy1 = p.lc1 * c1 * s.dq[0];
        double vx2 = (-L * s1 - p.a * c1) * s.dq[0] + c1 * s.dq[1];
        double vy2 = (L * c1 - p.a * s1) * s.dq[0] + s1 * s.dq[1];
        double expected =
            0.5 * p.m1 * (vx1 * vx1 + vy1 * vy1) + 0.5 * p.m2 * (vx2 * vx2 + vy2 * vy2);
        expected += 0.5 * (p.I1z + p.I2z) * s.dq[0] * s.dq[0];

        double speed2 = (longest_L(s.q[1]) + fabs(p.a)) * fabs(s.dq[0]) + fabs(s.dq[1]);
        double scale = d11_scale(s.q[1]) * s.dq[0] * s.dq[0] + p.m2 * speed2 * speed2;
        ASSERT_CLOSE(expected, arm_kinetic_energy(arm_at(s.q, s.dq)), 8 * EPS * scale);
    }
}

/* ---- Equations of motion -------------------------------------------------------------------- */

static void test_inverse_dynamics_is_14_and_15(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double tau[2], D[2][2], C[2][2], coriolis[2], gravity[2], scale[2];
        next_sample();
        double s1 = sin(s.q[0]), c1 = cos(s.q[0]), q2 = s.q[1];
        double dq1 = s.dq[0], dq2 = s.dq[1], ddq1 = s.ddq[0], ddq2 = s.ddq[1];
        double d11 = p.m2 * p.a * p.a + p.m2 * p.l1 * p.l1 + 2.0 * p.m2 * p.l1 * q2 +
                     p.m1 * p.lc1 * p.lc1 + p.m2 * q2 * q2 + p.I1z + p.I2z;
        double c211 = p.l1 * p.m2 + p.m2 * q2;
        double expected1 = d11 * ddq1 - p.a * p.m2 * ddq2 + c211 * dq2 * dq1 + c211 * dq1 * dq2 +
                           p.m1 * p.g * p.lc1 * c1 + p.m2 * p.g * (p.l1 * c1 - p.a * s1 + q2 * c1);
        double expected2 = -p.a * p.m2 * ddq1 + p.m2 * ddq2 - c211 * dq1 * dq1 + p.m2 * p.g * s1;

        arm_inverse_dynamics(arm_at(s.q, s.dq), s.ddq, tau);
        rp_test_force_scale(&p, &s, scale);
        ASSERT_CLOSE(expected1, tau[0], 16 * EPS * scale[0]);
        ASSERT_CLOSE(expected2, tau[1], 16 * EPS * scale[1]);

        arm_mass_matrix(arm_at(s.q, s.dq), D);
        arm_coriolis_matrix(arm_at(s.q, s.dq), C);
        arm_coriolis_forces(arm_at(s.q, s.dq), coriolis);
        arm_gravity_forces(arm_at(s.q, s.dq), gravity);
        for (int i = 0; i < 2; ++i) {
            double inertial = D[i][0] * ddq1 + D[i][1] * ddq2;
            ASSERT_CLOSE(inertial + C[i][0] * dq1 + C[i][1] * dq2 + gravity[i], tau[i],
                         16 * EPS * scale[i]);
            ASSERT_CLOSE(C[i][0] * dq1 + C[i][1] * dq2, coriolis[i], 16 * EPS * scale[i]);
        }
    }
}

static void test_forward_dynamics_inverts_inverse_dynamics(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double ddq[2], tau[2], force[2], acceleration[2];
        next_sample();
        /* a rounding of row 2 reaches joint 1 with the arm a */
        arm_inverse_dynamics(arm_at(s.q, s.dq), s.ddq, tau);
        arm_forward_dynamics(arm_at(s.q, s.dq), tau, ddq);
        memcpy(s.tau, tau, sizeof tau);
        rp_test_force_scale(&p, &s, force);
        rp_test_acceleration_scale(&p, s.q, force, acceleration);
        ASSERT_CLOSE(s.ddq[0], ddq[0], 16 * EPS * acceleration[0]);
        ASSERT_CLOSE(s.ddq[1], ddq[1], 16 * EPS * acceleration[1]);

        rp_test_random_state(&random_source, &s);
        arm_forward_dynamics(arm_at(s.q, s.dq), s.tau, s.ddq);
        arm_inverse_dynamics(arm_at(s.q, s.dq), s.ddq, tau);
        rp_test_force_scale(&p, &s, force);
        ASSERT_CLOSE(s.tau[0], tau[0], 16 * EPS * (force[0] + fabs(p.a) * force[1]));
        ASSERT_CLOSE(s.tau[1], tau[1], 16 * EPS * force[1]);
    }
}

/* Along q + dq t + ddq t^2 / 2: total energy, or with row = 1 the momentum dT/d dq1. */
static double conserved_on_path(const void *context, double t) {
    double q[2], dq[2], D[2][2];
    for (int i = 0; i < 2; ++i) {
        q[i] = s.q[i] + t * (s.dq[i] + 0.5 * t * s.ddq[i]);
        dq[i] = s.dq[i] + t * s.ddq[i];
    }
    arm_mass_matrix(arm_at(q, s.dq), D);
    return *(const int *)context
               ? D[0][0] * dq[0] + D[0][1] * dq[1]
               : arm_kinetic_energy(arm_at(q, dq)) + arm_potential_energy(arm_at(q, s.dq));
}

/* dE/dt = tau.dq and dp1/dt = tau1 - dP/dq1, since q1 is cyclic in T. Every second sample moves
 * freely in the horizontal plane, where both vanish; every fourth freely under gravity. */
static void test_energy_and_momentum_balance(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        next_sample();
        if (n % 2 == 1 || n % 4 == 0) {
            s.tau[0] = s.tau[1] = 0.0;
        }
        if (n % 2 == 1) {
            p.g = 0.0;
        }
        arm_forward_dynamics(arm_at(s.q, s.dq), s.tau, s.ddq);
        double power = s.tau[0] * s.dq[0] + s.tau[1] * s.dq[1];
        double weight = p.g * (p.m1 * p.lc1 * cos(s.q[0]) +
                               p.m2 * ((p.l1 + s.q[1]) * cos(s.q[0]) - p.a * sin(s.q[0])));

        /* w bounds the rate of q1 over the stencil of step 1 / (64 w). T and p are polynomials of t
         * of degree 6 and 5; P leaves a truncation of 2620 * 1.0625^9 / 630 (w h)^8 w, 2 epsilons
         * by h. Rounding: 5 epsilons, times 2.1. */
        double w = fmax(1.0, fmax(fabs(s.dq[0]), sqrt(fabs(s.ddq[0]))));
        double h = rp_test_power_of_two(1.0 / w) / 64;
        double q2 = fabs(s.q[1]) + fabs(s.dq[1]) / w + fabs(s.ddq[1]) / (w * w);
        double v2 = fabs(s.dq[1]) + fabs(s.ddq[1]) / w;
        double momentum = d11_scale(q2) * w + fabs(p.a) * p.m2 * v2;
        double energy = momentum * w + p.m2 * v2 * v2 + potential_scale(q2);
        double force = fabs(weight) + fabs(s.tau[0]);
        ASSERT_CLOSE(power, rp_test_derivative(conserved_on_path, &(int){0}, 0.0, h),
                     13 * EPS * energy / h);
        ASSERT_CLOSE(s.tau[0] - weight, rp_test_derivative(conserved_on_path, &(int){1}, 0.0, h),
                     13 * EPS * (momentum / h + force));
    }
}

/* ---- Limits with known answers -------------------------------------------------------------- */

static void accelerations_of(const double q[2], const double dq[2], const double tau[2]) {
    memcpy(s.q, q, sizeof s.q);
    memcpy(s.dq, dq, sizeof s.dq);
    memcpy(s.tau, tau, sizeof s.tau);
    arm_forward_dynamics(arm_at(s.q, s.dq), s.tau, s.ddq);
}

static void test_upright_slide_falls_freely(void) {
    rp_test_default_parameters(&p);
    p.a = 0.0;
    accelerations_of((double[2]){0.5 * RP_TEST_PI, 0.3}, (double[2]){0}, (double[2]){0});
    ASSERT_CLOSE(-p.g, s.ddq[1], EPS * p.g);
    ASSERT_CLOSE(0.0, s.ddq[0], 8 * EPS * p.g); /* cos of the rounded pi/2, by 1.5 / m */
}

static void test_centripetal_force_keeps_a_steady_rotation(void) {
    rp_test_default_parameters(&p);
    p.a = p.g = 0.0;
    double hold = -p.m2 * (p.l1 + 0.25) * 9.0;
    accelerations_of((double[2]){0.4, 0.25}, (double[2]){3.0, 0.0}, (double[2]){0.0, hold});
    ASSERT_CLOSE(0.0, s.ddq[0], 4 * EPS * 9.0);
    ASSERT_CLOSE(0.0, s.ddq[1], 4 * EPS * 9.0);
}

static void test_massless_slide_leaves_a_compound_pendulum(void) {
    rp_test_default_parameters(&p);
    p.m2 = 1e-9;
    accelerations_of((double[2]){0.7, 0.2}, (double[2]){1.5, 0.0}, (double[2]){0});
    double inertia = p.m1 * p.lc1 * p.lc1 + p.I1z + p.I2z;
    double expected = -p.m1 * p.g * p.lc1 * cos(0.7) / inertia;
    ASSERT_CLOSE(expected, s.ddq[0], 1e-8 * fabs(expected)); /* m2 against m1 */
}

/* Without inertia of link 1 the joint variables are curved coordinates of a free point mass. */
static void test_weightless_arm_leaves_link_2_a_projectile(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        next_sample();
        p.m1 = p.I2z = 0.0;
        p.I1z = p.m2 * ldexp(1.0, -60);
        s.q[1] = 0.5 + fabs(s.q[1]);
        double L = p.l1 + s.q[1], s1 = sin(s.q[0]), c1 = cos(s.q[0]), w = s.dq[0];
        accelerations_of(s.q, s.dq, (double[2]){0});
        /* along x1 and z1: relative, Euler, centripetal and Coriolis acceleration */
        double along_x1 = L * s.ddq[0] - p.a * w * w + 2.0 * w * s.dq[1];
        double along_z1 = s.ddq[1] - p.a * s.ddq[0] - L * w * w;
        double scale = (1.0 + fabs(p.a) / L) * (L * fabs(s.ddq[0]) + fabs(p.a) * w * w +
                                                2.0 * fabs(w * s.dq[1]) + fabs(p.g)) +
                       fabs(s.ddq[1]) + L * w * w;
        ASSERT_CLOSE(-p.g * c1, along_x1, 16 * EPS * scale);
        ASSERT_CLOSE(-p.g * s1, along_z1, 16 * EPS * scale);
    }
}

/* ---- Parameters ----------------------------------------------------------------------------- */

static void expect_valid(bool valid, double *field, double value) {
    double before = *field;
    *field = value;
    TEST_ASSERT_EQUAL(valid, rp_parameters_check(&p, NULL, 0));
    *field = before;
}

static void test_parameters_outside_their_range_are_refused(void) {
    rp_test_default_parameters(&p);
    TEST_ASSERT_TRUE(rp_parameters_check(&p, NULL, 0));
    double *fields[8] = {&p.m1, &p.I1z, &p.I2z, &p.l1, &p.lc1, &p.m2, &p.a, &p.g};
    for (int i = 0; i < 8; ++i) {
        expect_valid(false, fields[i], NAN);
        expect_valid(false, fields[i], INFINITY);
        expect_valid(false, fields[i], -INFINITY);
        expect_valid(i >= 6, fields[i], -1e-3); /* a and g have a sign */
        expect_valid(i != 5, fields[i], 0.0);
        expect_valid(true, fields[i], 1e-9);
        expect_valid(true, fields[i], 1e9);
    }
    expect_valid(false, &p.m2, -0.0);
    expect_valid(true, &p.m1, -0.0);
}

static void test_link_1_needs_some_inertia(void) {
    rp_test_default_parameters(&p);
    ASSERT_CLOSE(0.275, arm_fixed_inertia(&p), 2 * EPS * 0.275);
    p.I1z = p.I2z = 0.0;
    expect_valid(true, &p.m2, 1.0); /* m1 lc1^2 is left */
    expect_valid(false, &p.m1, 0.0);
    expect_valid(false, &p.lc1, 0.0);
    p.m1 = p.lc1 = 0.0;
    TEST_ASSERT_TRUE(arm_fixed_inertia(&p) == 0.0);
    expect_valid(true, &p.I1z, 1e-12);
    expect_valid(true, &p.I2z, 1e-12);
    expect_valid(false, &p.I2z, -1e-12);
}
