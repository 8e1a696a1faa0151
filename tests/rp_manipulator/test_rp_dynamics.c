/* Euler-Lagrange dynamics against the notes. Their derivatives are tested in test_rp_propagation.c;
 * two other derivations agree with them: test_rp_newton_euler.c and test_plant_lagrangian.py. */
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
    random_source.state = 7;
}
static void next_sample(void) {
    rp_test_random_parameters(&random_source, &p);
    rp_test_random_state(&random_source, &s);
}

/* Bound of the distance of link 2 from the joint axis. */
static double reach(void) {
    return p.l1 + fabs(s.q[1]) + fabs(p.a);
}

/* ---- Energies ------------------------------------------------------------------------------- */

static void test_potential_energy_is_weight_times_height(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        next_sample();
        double y1 = p.lc1 * sin(s.q[0]);
        double y2 = (p.l1 + s.q[1]) * sin(s.q[0]) + p.a * cos(s.q[0]);
        ASSERT_CLOSE(p.g * (p.m1 * y1 + p.m2 * y2), rp_potential_energy(&p, s.q),
                     8 * EPS * fabs(p.g) * (p.m1 * p.lc1 + p.m2 * reach()));
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

        double speed2 = reach() * fabs(s.dq[0]) + fabs(s.dq[1]);
        double d11 = rp_test_inertia(&p, fabs(s.q[1])) + p.m2 * p.a * p.a;
        double scale = d11 * s.dq[0] * s.dq[0] + p.m2 * speed2 * speed2;
        ASSERT_CLOSE(expected, rp_kinetic_energy(&p, s.q, s.dq), 8 * EPS * scale);
    }
}

/* ---- Equations of motion -------------------------------------------------------------------- */

/* The symbols that are not zero, and the matrix with which dD/dt - 2 C is skew symmetric. */
static void test_christoffel_symbols_and_coriolis_matrix_are_9_and_12(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double c[2][2][2], C[2][2];
        next_sample();
        rp_christoffel(&p, s.q, c);
        rp_coriolis_matrix(&p, s.q, s.dq, C);
        double c211 = p.l1 * p.m2 + p.m2 * s.q[1], dq1 = s.dq[0], dq2 = s.dq[1];
        double symbols[2][2][2] = {{{0.0, -c211}, {c211, 0.0}}, {{c211, 0.0}, {0.0, 0.0}}};
        double matrix[2][2] = {{c211 * dq2, c211 * dq1}, {-c211 * dq1, 0.0}};
        double bound = 4 * EPS * p.m2 * reach();
        for (int i = 0; i < 2; ++i) {
            for (int j = 0; j < 2; ++j) {
                ASSERT_CLOSE(matrix[i][j], C[i][j], bound * (fabs(dq1) + fabs(dq2)));
                ASSERT_CLOSE(symbols[i][j][0], c[i][j][0], bound);
                ASSERT_CLOSE(symbols[i][j][1], c[i][j][1], bound);
            }
        }
    }
}

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

        rp_inverse_dynamics(&p, s.q, s.dq, s.ddq, tau);
        rp_test_force_scale(&p, &s, scale);
        ASSERT_CLOSE(expected1, tau[0], 16 * EPS * scale[0]);
        ASSERT_CLOSE(expected2, tau[1], 16 * EPS * scale[1]);

        rp_mass_matrix(&p, s.q, D);
        rp_coriolis_matrix(&p, s.q, s.dq, C);
        rp_coriolis_forces(&p, s.q, s.dq, coriolis);
        rp_gravity_forces(&p, s.q, gravity);
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
        rp_inverse_dynamics(&p, s.q, s.dq, s.ddq, tau);
        rp_forward_dynamics(&p, s.q, s.dq, tau, ddq);
        memcpy(s.tau, tau, sizeof tau);
        rp_test_force_scale(&p, &s, force);
        rp_test_acceleration_scale(&p, s.q, force, acceleration);
        ASSERT_CLOSE(s.ddq[0], ddq[0], 16 * EPS * acceleration[0]);
        ASSERT_CLOSE(s.ddq[1], ddq[1], 16 * EPS * acceleration[1]);

        rp_test_random_state(&random_source, &s);
        rp_forward_dynamics(&p, s.q, s.dq, s.tau, s.ddq);
        rp_inverse_dynamics(&p, s.q, s.dq, s.ddq, tau);
        rp_test_force_scale(&p, &s, force);
        ASSERT_CLOSE(s.tau[0], tau[0], 16 * EPS * (force[0] + fabs(p.a) * force[1]));
        ASSERT_CLOSE(s.tau[1], tau[1], 16 * EPS * force[1]);
    }
}

/* ---- Parameters ----------------------------------------------------------------------------- */

static void expect_valid(bool valid, double *field, double value) {
    double before = *field;
    *field = value;
    TEST_ASSERT_EQUAL(valid, rp_parameters_check(&p));
    *field = before;
}

static void test_parameters_outside_their_range_are_refused(void) {
    rp_test_default_parameters(&p);
    TEST_ASSERT_TRUE(rp_parameters_check(&p));
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
    ASSERT_CLOSE(0.275, rp_fixed_inertia(&p), 2 * EPS * 0.275);
    p.I1z = p.I2z = 0.0;
    expect_valid(true, &p.m2, 1.0); /* m1 lc1^2 is left */
    expect_valid(false, &p.m1, 0.0);
    expect_valid(false, &p.lc1, 0.0);
    p.m1 = p.lc1 = 0.0;
    TEST_ASSERT_TRUE(rp_fixed_inertia(&p) == 0.0);
    expect_valid(true, &p.I1z, 1e-12);
    expect_valid(true, &p.I2z, 1e-12);
    expect_valid(false, &p.I2z, -1e-12);
}
