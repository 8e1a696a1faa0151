/* The arm as the instance sees it: its outputs are those of its equations, its Jacobian is what
 * propagation gives, which test_rp_propagation.c compares with differences. */
#include "last_text.h"
#include "rp_model.h"
#include "rp_recursion.h"
#include "rp_test_support.h"
#include "unity.h"

#include <stddef.h>
#include <string.h>

enum { STATES = 4 };

static struct rp_test_random random_source;
static struct rp_values v; /* the sample, its calculated fields not a number */
static double x[STATES];   /* its states and inputs */
static double u[2];

void setUp(void) {
    random_source.state = 29;
}
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

/* ---- Outputs -------------------------------------------------------------------------------- */

static void test_outputs_are_the_functions_bit_for_bit(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        next_sample();
        const struct arm arm = arm_in_state(&v.parameters, v.q, v.dq);
        struct rp_values expected = v;
        arm_forward_dynamics(&arm, v.tau, expected.ddq);
        arm_end_effector_position(&arm, expected.ee_position);
        arm_end_effector_velocity(&arm, expected.ee_velocity);
        expected.kinetic_energy = arm_kinetic_energy(&arm);
        expected.potential_energy = arm_potential_energy(&arm);
        expected.total_energy = expected.kinetic_energy + expected.potential_energy;
        expected.actuator_power = v.tau[0] * v.dq[0] + v.tau[1] * v.dq[1];
        arm_mass_matrix(&arm, expected.D);
        arm_coriolis_forces(&arm, expected.coriolis);
        arm_gravity_forces(&arm, expected.gravity);
        const struct joint_loads loads = loads_of_motion(&arm, v.tau, expected.ddq);
        write_loads(&loads, &expected.loads);
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
        ASSERT_OK(rp_model.right_hand_side(&v, 3.0, x, u, dx));
        TEST_ASSERT_EQUAL_MEMORY(outputs.dq, dx, sizeof dx);
    }
}

/* ---- Jacobian ------------------------------------------------------------------------------- */

/* Both arithmetics apply the same rules to the same equations. */
static void test_jacobian_is_what_propagation_gives(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        double J[STATES][STATES]; /* J[j] is column j */
        next_sample();
        const struct rp_values sample = v;
        memset(J, 0xff, sizeof J);
        poison_states_and_inputs();
        ASSERT_OK(rp_model.jacobian(&v, 3.0, x, u, J[0]));
        v = sample;
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
