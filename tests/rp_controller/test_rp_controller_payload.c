/* The law with a payload, against the dynamics of the plant that carries it. */
#include "rp_controller.h"
#include "rp_plant.h"
#include "rp_test_support.h"

#include <float.h>
#include <math.h>
#include <string.h>
#include <unity.h>

static struct rp_test_random random_source;
static struct rp_controller_parameters p;
static struct rp_plant_parameters plant;
static struct rp_controller_inputs inputs;
static double w[2];

static const struct rp_plant_modes attached = {
    .joint = {RP_PLANT_FREE, RP_PLANT_FREE},
    .payload = RP_PLANT_ATTACHED,
};

void setUp(void) {
    random_source.state = 16;
}

static double positive(double high) {
    return fabs(rp_test_uniform(&random_source, 0.01, high));
}

/* The controller knows all of the plant, which has no drives. */
static void next_sample(int mode) {
    memset(&p, 0, sizeof p);
    memset(&plant, 0, sizeof plant);
    rp_test_random_parameters(&random_source, &p.arm);
    p.mode = mode;
    p.tracking_time = 1.0;
    p.payload_mass = positive(5.0);
    p.payload_inertia = positive(1.0);
    p.payload_x = rp_test_uniform(&random_source, -0.5, 0.5);
    p.payload_z = rp_test_uniform(&random_source, -0.5, 0.5);
    for (int i = 0; i < 2; i++) {
        p.Kp[i] = positive(400.0);
        p.Kd[i] = positive(40.0);
        p.Ki[i] = positive(400.0);
        p.inertia[i] = positive(5.0);
        p.limit[i] = positive(400.0);
        w[i] = rp_test_uniform(&random_source, -20.0, 20.0);
        inputs.q_ref[i] = rp_test_uniform(&random_source, -2.0, 2.0);
        inputs.dq_ref[i] = rp_test_uniform(&random_source, -2.0, 2.0);
        inputs.ddq_ref[i] = rp_test_uniform(&random_source, -2.0, 2.0);
        inputs.q[i] = rp_test_uniform(&random_source, -2.0, 2.0);
        inputs.dq[i] = rp_test_uniform(&random_source, -2.0, 2.0);
    }
    plant.arm = p.arm;
    plant.payload_mass = p.payload_mass;
    plant.payload_inertia = p.payload_inertia;
    plant.payload_x = p.payload_x;
    plant.payload_z = p.payload_z;
    for (int i = 0; i < 2; i++) {
        plant.stops[i] = RP_PLANT_STOPS_NONE;
    }
}

/* The arm whose link 2 is link 2 with the payload, for bounds. */
static struct rp_parameters whole_arm(void) {
    struct rp_parameters arm = p.arm;
    const double mass = arm.m2 + p.payload_mass;
    const double share = p.payload_mass / mass;
    arm.I2z += p.payload_inertia +
               arm.m2 * share * (p.payload_x * p.payload_x + p.payload_z * p.payload_z);
    arm.a += share * p.payload_x;
    arm.l1 += share * p.payload_z;
    arm.m2 = mass;
    return arm;
}

static void test_computed_torque_leaves_linear_errors_on_the_plant(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        next_sample(RP_CONTROLLER_COMPUTED_TORQUE);
        struct rp_test_state state = {.q = {inputs.q[0], inputs.q[1]},
                                      .dq = {inputs.dq[0], inputs.dq[1]}};
        for (int i = 0; i < 2; i++) {
            state.ddq[i] = inputs.ddq_ref[i] + p.Kd[i] * (inputs.dq_ref[i] - inputs.dq[i]) +
                           p.Kp[i] * (inputs.q_ref[i] - inputs.q[i]) + w[i];
        }
        struct rp_plant_inputs efforts = {.tau = {0.0}};
        struct rp_plant_motion motion;
        rp_controller_unlimited(&p, true, &inputs, w, efforts.tau);
        rp_plant_motion(&plant, &attached, inputs.q, inputs.dq, &efforts, &motion);

        const struct rp_parameters arm = whole_arm();
        double force[2];
        double scale[2];
        rp_test_force_scale(&arm, &state, force);
        rp_test_acceleration_scale(&arm, inputs.q, force, scale);
        for (int i = 0; i < 2; i++) {
            ASSERT_CLOSE(state.ddq[i], motion.ddq[i], 32 * DBL_EPSILON * scale[i]);
        }
    }
}

/* At rest on the target: the forces of the plant and the efforts cancel to the last bit. */
static void test_gravity_compensation_holds_arm_and_payload(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        next_sample(RP_CONTROLLER_PD_GRAVITY);
        memcpy(inputs.q_ref, inputs.q, sizeof inputs.q);
        memset(inputs.dq, 0, sizeof inputs.dq);
        memset(inputs.dq_ref, 0, sizeof inputs.dq_ref);
        memset(w, 0, sizeof w);
        struct rp_plant_inputs efforts = {.tau = {0.0}};
        double forces[2];
        rp_controller_unlimited(&p, true, &inputs, w, efforts.tau);
        rp_plant_forces(&plant, &attached, inputs.q, inputs.dq, &efforts, forces);
        TEST_ASSERT_TRUE(forces[0] == 0.0 && forces[1] == 0.0);
        rp_controller_unlimited(&p, false, &inputs, w, efforts.tau);
        rp_plant_forces(&plant, &attached, inputs.q, inputs.dq, &efforts, forces);
        TEST_ASSERT_TRUE(p.arm.g == 0.0 || forces[1] != 0.0);
    }
}

static void test_a_payload_of_nothing_changes_no_bit(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        next_sample(RP_CONTROLLER_PD + n % 3);
        p.payload_mass = p.payload_inertia = 0.0;
        double with[2];
        double without[2];
        double by_w_with[2][2];
        double by_w_without[2][2];
        rp_controller_unlimited(&p, true, &inputs, w, with);
        rp_controller_unlimited(&p, false, &inputs, w, without);
        TEST_ASSERT_EQUAL_MEMORY(without, with, sizeof with);
        rp_controller_integral_jacobian(&p, true, &inputs, w, by_w_with);
        rp_controller_integral_jacobian(&p, false, &inputs, w, by_w_without);
        TEST_ASSERT_EQUAL_MEMORY(by_w_without, by_w_with, sizeof by_w_with);
    }
}

/* PD has no model of the arm: the payload does not matter. */
static void test_pd_does_not_know_the_payload(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        next_sample(RP_CONTROLLER_PD);
        double with[2];
        double without[2];
        rp_controller_unlimited(&p, true, &inputs, w, with);
        rp_controller_unlimited(&p, false, &inputs, w, without);
        TEST_ASSERT_EQUAL_MEMORY(without, with, sizeof with);
    }
}

/* The part of the effort beyond the limit changes with w as D of the plant. */
static void test_anti_windup_follows_the_mass_matrix_of_the_plant(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        next_sample(RP_CONTROLLER_COMPUTED_TORQUE);
        p.limit[0] = p.limit[1] = 0.0;
        double by_w[2][2];
        struct rp_plant_inertia inertia;
        rp_controller_integral_jacobian(&p, true, &inputs, w, by_w);
        rp_plant_inertia(&plant, true, inputs.q[1], &inertia);
        for (int i = 0; i < 2; i++) {
            for (int j = 0; j < 2; j++) {
                const double expected = -inertia.D[i][j] / (p.inertia[i] * p.tracking_time);
                ASSERT_CLOSE(expected, by_w[i][j], 8 * DBL_EPSILON * fabs(expected));
            }
        }
    }
}
