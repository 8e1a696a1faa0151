#include "plant_test_support.h"

#include "unity.h"

#include <math.h>
#include <string.h>

void plant_test_start(struct rp_plant_values *v) {
    memset(v, 0, sizeof *v);
    rp_test_default_parameters(&v->parameters.arm);
    v->parameters.stops[0] = v->parameters.stops[1] = RP_PLANT_STOPS_NONE;
    v->parameters.grasp = RP_PLANT_GRASP_KEEP_VELOCITY;
}

void plant_test_random_arm(struct rp_test_random *random, struct rp_plant_values *v) {
    struct rp_test_state state;
    plant_test_start(v);
    memset(v->D, 0xff, sizeof *v - offsetof(struct rp_plant_values, D));
    rp_test_random_parameters(random, &v->parameters.arm);
    rp_test_random_state(random, &state);
    memcpy(v->inputs.tau, state.tau, sizeof state.tau);
    memcpy(v->q, state.q, sizeof state.q);
    memcpy(v->dq, state.dq, sizeof state.dq);
}

static double positive_or_zero(struct rp_test_random *random, double high) {
    const double value = rp_test_uniform(random, 0.0, high);
    return rp_test_random_bits(random) % 4 == 0 ? 0.0 : value;
}

void plant_test_random_plant(struct rp_test_random *random, struct rp_plant_values *v) {
    plant_test_random_arm(random, v);
    struct rp_plant_parameters *p = &v->parameters;
    for (int i = 0; i < 2; i++) {
        p->armature[i] = positive_or_zero(random, 2.0);
        p->damping[i] = positive_or_zero(random, 3.0);
        p->coulomb_friction[i] = positive_or_zero(random, 5.0);
        if (rp_test_random_bits(random) % 2 == 0) {
            p->breakaway_friction[i] = p->coulomb_friction[i] + rp_test_uniform(random, 0.125, 5.0);
            p->stribeck_velocity[i] = rp_test_uniform(random, 0.5, 5.0);
        }
        v->modes.joint[i] = (int)(rp_test_random_bits(random) % 4) - 1;
    }
    p->payload_mass = positive_or_zero(random, 4.0);
    p->payload_inertia = positive_or_zero(random, 1.0);
    p->payload_x = rp_test_uniform(random, -0.5, 0.5);
    p->payload_z = rp_test_uniform(random, -0.5, 0.5);
    for (int i = 0; i < 3; i++) {
        v->inputs.wrench[i] = rp_test_uniform(random, -20.0, 20.0);
    }
    v->payload_attached = (int)(rp_test_random_bits(random) % 2);
    v->modes.payload = v->payload_attached != 0 ? RP_PLANT_ATTACHED : RP_PLANT_RELEASED;
}

void plant_test_outputs(struct rp_plant_values *v) {
    TEST_ASSERT_EQUAL_INT(STATUS_OK, rp_plant_model.outputs(v, 3.0));
    v->D[1][0] = v->D[0][1];
}

void plant_test_update_with(struct rp_plant_values *v, const bool *triggered, const double *du) {
    static const double constant[PLANT_INPUTS] = {0.0};
    static const double tolerance[PLANT_STATES] = {1e-10, 1e-10, 1e-10, 1e-10};
    const struct event event = {
        .t = 3.0, .triggered = triggered, .du = du != NULL ? du : constant, .tolerance = tolerance};
    TEST_ASSERT_EQUAL_INT(STATUS_OK, rp_plant_model.events->update(v, &event));
}

void plant_test_update(struct rp_plant_values *v, int indicator) {
    bool triggered[RP_PLANT_INDICATORS] = {false};
    if (indicator >= 0) {
        triggered[indicator] = true;
    }
    plant_test_update_with(v, indicator >= 0 ? triggered : NULL, NULL);
}

void plant_test_same(double expected, double actual, int line) {
    const double a = expected + 0.0; // -0 + 0 is +0
    const double b = actual + 0.0;
    UNITY_TEST_ASSERT(memcmp(&a, &b, sizeof a) == 0 && !isnan(a), (UNITY_UINT)line,
                      "not the same bits");
}
