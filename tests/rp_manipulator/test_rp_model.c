/* The arm as the instance sees it: its outputs are those of rp_manipulator.h, and its Jacobian that
 * of its right-hand side. */
#include "last_text.h"
#include "rp_model.h"
#include "rp_test_support.h"
#include "unity.h"

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

#define EPS DBL_EPSILON

enum { STATES = 4 };

static struct rp_test_random random_source;
static struct rp_values v; /* the sample, its calculated fields not a number */
static double x[STATES];   /* its states and inputs */
static double u[2];

void setUp(void) {
    random_source.state = 29;
}
void tearDown(void) {}

static void next_sample(void) {
    struct rp_test_state state;
    memset(&v, 0xff, sizeof v); /* NaN */
    rp_test_random_parameters(&random_source, &v.parameters);
    rp_test_random_state(&random_source, &state);
    memcpy(v.tau, state.tau, sizeof state.tau);
    memcpy(v.q, state.q, sizeof state.q);
    memcpy(v.dq, state.dq, sizeof state.dq);
    memcpy(x, v.q, sizeof x);
    memcpy(u, v.tau, sizeof u);
}

/* Leaves the parameters, which is all that a right-hand side may read there. */
static void poison_states_and_inputs(void) {
    memset((char *)&v + offsetof(struct rp_values, tau), 0xff,
           sizeof v - offsetof(struct rp_values, tau));
}

static void right_hand_side(const double at[STATES], double dx[STATES]) {
    ASSERT_OK(rp_model.right_hand_side(&v, 3.0, at, u, dx));
}

static void jacobian(double J[STATES][STATES]) { /* J[j] is column j */
    memset(J, 0xff, sizeof(double[STATES][STATES]));
    ASSERT_OK(rp_model.jacobian(&v, 3.0, x, u, J[0]));
}

/* ---- Outputs -------------------------------------------------------------------------------- */

static void test_outputs_are_the_functions_bit_for_bit(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        next_sample();
        const struct rp_parameters *p = &v.parameters;
        struct rp_values expected = v;
        rp_forward_dynamics(p, v.q, v.dq, v.tau, expected.ddq);
        rp_end_effector_position(p, v.q, expected.ee_position);
        rp_end_effector_velocity(p, v.q, v.dq, expected.ee_velocity);
        expected.kinetic_energy = rp_kinetic_energy(p, v.q, v.dq);
        expected.potential_energy = rp_potential_energy(p, v.q);
        expected.total_energy = expected.kinetic_energy + expected.potential_energy;
        expected.actuator_power = v.tau[0] * v.dq[0] + v.tau[1] * v.dq[1];
        rp_mass_matrix(p, v.q, expected.D);
        rp_coriolis_forces(p, v.q, v.dq, expected.coriolis);
        rp_gravity_forces(p, v.q, expected.gravity);
        rp_newton_euler(p, v.q, v.dq, expected.ddq, &expected.loads);
        ASSERT_OK(rp_model.outputs(&v, 3.0));
        TEST_ASSERT_EQUAL_MEMORY(&expected, &v, sizeof v);
    }
}

static void test_right_hand_side_is_the_rates_that_are_output(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double dx[STATES];
        next_sample();
        struct rp_values outputs = v;
        ASSERT_OK(rp_model.outputs(&outputs, 3.0));
        poison_states_and_inputs();
        right_hand_side(x, dx);
        TEST_ASSERT_EQUAL_MEMORY(outputs.dq, dx, sizeof dx);
    }
}

/* ---- Jacobian ------------------------------------------------------------------------------- */

/* x'[row] while one state is at a value. */
struct rate {
    int row;
    int state;
};

static double rate_at(const void *context, double value) {
    const struct rate *rate = context;
    double moved[STATES];
    double dx[STATES];
    memcpy(moved, x, sizeof x);
    moved[rate->state] = value;
    right_hand_side(moved, dx);
    return dx[rate->row];
}

static void test_jacobian_is_that_of_the_right_hand_side(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double J[STATES][STATES];
        next_sample();
        struct rp_test_state state = {.q = {x[0], x[1]}, .dq = {x[2], x[3]}, .tau = {u[0], u[1]}};
        poison_states_and_inputs();
        jacobian(J);

        /* steps and bounds as for rp_dynamics_jacobians in test_rp_dynamics.c */
        double pole = sqrt(rp_test_inertia(&v.parameters, x[1]) / v.parameters.m2);
        const double steps[STATES] = {1.0 / 32, rp_test_power_of_two(pole) / 128, 0.25, 0.25};
        for (int j = 0; j < STATES; ++j) {
            double h = steps[j], force[2], scale[2];
            struct rp_test_state furthest = state;
            double *varied = j < 2 ? &furthest.q[j] : &furthest.dq[j - 2];
            *varied = fabs(*varied) + 4.0 * h;
            rp_test_force_scale(&v.parameters, &furthest, force);
            rp_test_acceleration_scale(&v.parameters, state.q, force, scale);
            for (int i = 0; i < 2; ++i) {
                double expected = rp_test_derivative(rate_at, &(struct rate){2 + i, j}, x[j], h);
                ASSERT_CLOSE(expected, J[j][2 + i], 32 * EPS * scale[i] / h);
                TEST_ASSERT_TRUE(J[j][i] == (j == 2 + i ? 1.0 : 0.0));
            }
        }
    }
}

/* J q1'' = tau1 + a f2 + m2 L q1' (a q1' - 2 q2') - g c1 (m1 lc1 + m2 L) and
 * q2'' = f2 / m2 + L q1'^2 - g s1 + a q1'', differentiated by hand. */
static void test_jacobian_is_the_one_written_out(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double by[STATES][STATES];
        next_sample();
        jacobian(by);
        const struct rp_parameters *p = &v.parameters;
        double m2 = p->m2, a = p->a, g = p->g, L = p->l1 + x[1], dq1 = x[2], dq2 = x[3];
        double s1 = sin(x[0]), c1 = cos(x[0]), J = rp_test_inertia(p, x[1]);
        double lever = p->m1 * p->lc1 + m2 * L;
        double ddq1 = u[0] + a * u[1] + m2 * L * dq1 * (a * dq1 - 2.0 * dq2) - g * c1 * lever;
        ddq1 /= J;
        const double torque[STATES] = {
            g * s1 * lever,
            m2 * dq1 * (a * dq1 - 2.0 * dq2) - g * c1 * m2 - 2.0 * m2 * L * ddq1,
            2.0 * m2 * L * (a * dq1 - dq2),
            -2.0 * m2 * L * dq1,
        };
        const double own[STATES] = {-g * c1, dq1 * dq1, 2.0 * L * dq1, 0.0};

        /* the sums of the absolute values of the terms */
        double A = fabs(a), G = fabs(g), l = fabs(L), w = fabs(dq1), r = fabs(dq2);
        double inertial = m2 * w * (A * w + 2.0 * r), weight = G * (p->m1 * p->lc1 + m2 * l);
        double terms = (fabs(u[0]) + A * fabs(u[1]) + l * inertial + weight) / J;
        const double torque_terms[STATES] = {weight, inertial + G * m2 + 2.0 * m2 * l * terms,
                                             2.0 * m2 * l * (A * w + r), 2.0 * m2 * l * w};
        const double own_terms[STATES] = {G, w * w, 2.0 * l * w, 0.0};
        for (int j = 0; j < STATES; ++j) {
            ASSERT_CLOSE(torque[j] / J, by[j][2], 16 * EPS * torque_terms[j] / J);
            ASSERT_CLOSE(own[j] + a * torque[j] / J, by[j][3],
                         16 * EPS * (A * torque_terms[j] / J + own_terms[j]));
        }
    }
}

/* Both arithmetics apply the same rules to the same equations. */
static void test_jacobian_is_what_propagation_gives(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double J[STATES][STATES];
        next_sample();
        jacobian(J);
        for (int j = 0; j < STATES; ++j) {
            struct rp_values first;
            memset(&first, 0, sizeof first);
            (j < 2 ? first.q : first.dq)[j % 2] = 1.0;
            ASSERT_OK(rp_model.propagate(&v, 3.0, 0.0, &first, NULL));
            for (int i = 0; i < 2; ++i) {
                TEST_ASSERT_TRUE(J[j][i] == first.dq[i]);
                TEST_ASSERT_TRUE(J[j][2 + i] == first.ddq[i]);
            }
        }
    }
}
