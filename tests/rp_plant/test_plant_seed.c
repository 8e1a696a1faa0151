/* With every feature off the plant is the manipulator, bit for bit up to the sign of zero. */
#include "last_text.h"
#include "plant_test_support.h"
#include "rp_model.h"
#include "unity.h"

#include <string.h>

static struct rp_test_random random_source;
static struct rp_plant_values plant;
static struct rp_values arm;

void setUp(void) {
    random_source.state = 31;
}

/* Each feature is off in one of its ways. */
static void next_sample(void) {
    plant_test_random_arm(&random_source, &plant);
    struct rp_plant_parameters *p = &plant.parameters;
    if (rp_test_random_bits(&random_source) % 2 == 0) {
        // nothing to attach; these say nothing without friction, stops and mass
        plant.payload_attached = 1;
        p->payload_x = rp_test_uniform(&random_source, -1.0, 1.0);
        p->payload_z = rp_test_uniform(&random_source, -1.0, 1.0);
        p->stribeck_velocity[0] = 1.0;
        p->restitution[1] = 0.5;
    }
    if (rp_test_random_bits(&random_source) % 2 == 0) {
        plant_test_update(&plant, -1);
    }
    memset(&arm, 0xff, sizeof arm);
    arm.parameters = p->arm;
    memcpy(arm.tau, plant.inputs.tau, sizeof arm.tau);
    memcpy(arm.q, plant.q, sizeof arm.q);
    memcpy(arm.dq, plant.dq, sizeof arm.dq);
}

#define ASSERT_SAME_ARRAY(expected, actual)                                                        \
    do {                                                                                           \
        for (size_t i_ = 0; i_ < sizeof(expected) / sizeof(double); i_++) {                        \
            ASSERT_SAME(((const double *)(expected))[i_], ((const double *)(actual))[i_]);         \
        }                                                                                          \
    } while (0)

static void assert_same_fields(const struct rp_values *expected,
                               const struct rp_plant_values *actual) {
    ASSERT_SAME_ARRAY(expected->ddq, actual->ddq);
    ASSERT_SAME_ARRAY(expected->ee_position, actual->ee_position);
    ASSERT_SAME_ARRAY(expected->ee_velocity, actual->ee_velocity);
    ASSERT_SAME(expected->kinetic_energy, actual->kinetic_energy);
    ASSERT_SAME(expected->potential_energy, actual->potential_energy);
    ASSERT_SAME(expected->total_energy, actual->total_energy);
    ASSERT_SAME(expected->actuator_power, actual->actuator_power);
    ASSERT_SAME_ARRAY(expected->D, actual->D);
    ASSERT_SAME_ARRAY(expected->coriolis, actual->coriolis);
    ASSERT_SAME_ARRAY(expected->gravity, actual->gravity);
    ASSERT_SAME_ARRAY(expected->loads.f1, actual->loads.f1);
    ASSERT_SAME_ARRAY(expected->loads.tau1, actual->loads.tau1);
    ASSERT_SAME_ARRAY(expected->loads.f2, actual->loads.f2);
    ASSERT_SAME_ARRAY(expected->loads.tau2, actual->loads.tau2);
}

static void test_outputs_are_those_of_the_manipulator(void) {
    for (int n = 0; n < 10 * RP_TEST_SAMPLES; n++) {
        next_sample();
        plant_test_outputs(&plant);
        ASSERT_OK(rp_model.outputs(&arm, 3.0));
        assert_same_fields(&arm, &plant);
        for (int i = 0; i < 2; i++) {
            ASSERT_SAME(0.0, plant.friction[i]);
            ASSERT_SAME(0.0, plant.stop_force[i]);
        }
        ASSERT_SAME(0.0, plant.friction_power);
    }
}

static void test_right_hand_side_and_jacobian_are_those_of_the_manipulator(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        double expected[PLANT_STATES * PLANT_STATES];
        double actual[PLANT_STATES * PLANT_STATES];
        next_sample();
        const double x[PLANT_STATES] = {plant.q[0], plant.q[1], plant.dq[0], plant.dq[1]};
        const double u[PLANT_INPUTS] = {plant.inputs.tau[0], plant.inputs.tau[1]};
        ASSERT_OK(rp_model.right_hand_side(&arm, 3.0, x, u, expected));
        ASSERT_OK(rp_plant_model.right_hand_side(&plant, 3.0, x, u, actual));
        for (int i = 0; i < PLANT_STATES; i++) {
            ASSERT_SAME(expected[i], actual[i]);
        }
        ASSERT_OK(rp_model.jacobian(&arm, 3.0, x, u, expected));
        ASSERT_OK(rp_plant_model.jacobian(&plant, 3.0, x, u, actual));
        ASSERT_SAME_ARRAY(expected, actual);
    }
}

/* A direction in the space of what both models have. */
static void next_direction(struct rp_values *of_arm, struct rp_plant_values *of_plant) {
    memset(of_arm, 0, sizeof *of_arm);
    memset(of_plant, 0, sizeof *of_plant);
    double *parameters = (double *)&of_arm->parameters;
    for (size_t i = 0; i < sizeof of_arm->parameters / sizeof(double); i++) {
        parameters[i] = rp_test_uniform(&random_source, -1.0, 1.0);
    }
    for (int i = 0; i < 2; i++) {
        of_arm->tau[i] = rp_test_uniform(&random_source, -1.0, 1.0);
        of_arm->q[i] = rp_test_uniform(&random_source, -1.0, 1.0);
        of_arm->dq[i] = rp_test_uniform(&random_source, -1.0, 1.0);
    }
    of_plant->parameters.arm = of_arm->parameters;
    memcpy(of_plant->inputs.tau, of_arm->tau, sizeof of_arm->tau);
    memcpy(of_plant->q, of_arm->q, sizeof of_arm->q);
    memcpy(of_plant->dq, of_arm->dq, sizeof of_arm->dq);
}

static void test_derivatives_are_those_of_the_manipulator(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        struct rp_values arm_first;
        struct rp_values arm_second;
        struct rp_plant_values first;
        struct rp_plant_values second;
        next_sample();
        next_direction(&arm_first, &first);
        next_direction(&arm_second, &second);
        ASSERT_OK(rp_model.propagate(&arm, 3.0, 0.0, &arm_first, &arm_second));
        ASSERT_OK(rp_plant_model.propagate(&plant, 3.0, 0.0, &first, &second));
        assert_same_fields(&arm_first, &first);
        assert_same_fields(&arm_second, &second);
    }
}

static void test_no_event_is_possible(void) {
    plant_test_start(&plant);
    TEST_ASSERT_FALSE(rp_plant_model.events->are_possible(&plant));
    TEST_ASSERT_FALSE(rp_plant_model.events->is_at_rest(&plant));
    struct indicator indicators[RP_PLANT_INDICATORS];
    rp_plant_model.events->describe(&plant, indicators);
    for (int k = 0; k < RP_PLANT_INDICATORS; k++) {
        TEST_ASSERT_EQUAL_INT(INDICATOR_UNUSED, indicators[k].kind);
    }
}
