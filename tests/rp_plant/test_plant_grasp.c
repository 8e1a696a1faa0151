/* Grasp of a payload at rest: momenta, closed form, energy. */
#include "plant_test_support.h"
#include "rp_plant_impact.h"
#include "unity.h"

#include <float.h>
#include <math.h>

#define EPS DBL_EPSILON

static struct rp_test_random random_source;
static struct rp_plant_values v;
static double after[2];

void setUp(void) {
    random_source.state = 47;
}

static void next_sample(void) {
    plant_test_random_plant(&random_source, &v);
}

static void test_momenta_of_the_joints_are_kept(void) {
    for (int n = 0; n < 10 * RP_TEST_SAMPLES; n++) {
        next_sample();
        struct rp_plant_inertia without;
        struct rp_plant_inertia with;
        const double loss = rp_plant_grasp_at_rest(&v.parameters, v.q, v.dq, after);
        rp_plant_inertia(&v.parameters, false, v.q[1], &without);
        rp_plant_inertia(&v.parameters, true, v.q[1], &with);
        const double condition = with.D[0][0] * with.D[1][1] / with.determinant;
        for (int i = 0; i < 2; i++) {
            double kept = 0.0;
            double scale = 0.0;
            for (int j = 0; j < 2; j++) {
                kept += with.D[i][j] * after[j] - without.D[i][j] * v.dq[j];
                scale += fabs(with.D[i][j]) * (fabs(after[j]) + fabs(v.dq[j]));
            }
            ASSERT_CLOSE(0.0, kept, 32 * EPS * condition * scale);
        }
        const double before_energy = rp_plant_kinetic_energy(&v.parameters, false, v.q, v.dq);
        const double after_energy = rp_plant_kinetic_energy(&v.parameters, true, v.q, after);
        TEST_ASSERT_TRUE(loss >= 0.0);
        const double scale = with.D[0][0] * v.dq[0] * v.dq[0] + with.D[1][1] * v.dq[1] * v.dq[1];
        ASSERT_CLOSE(before_energy - after_energy, loss, 64 * EPS * condition * scale);
    }
}

static void test_nothing_is_lost_at_rest_or_without_payload(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        next_sample();
        const double rest[2] = {0.0, 0.0};
        ASSERT_SAME(0.0, rp_plant_grasp_at_rest(&v.parameters, v.q, rest, after));
        ASSERT_SAME(0.0, after[0]);
        ASSERT_SAME(0.0, after[1]);
        v.parameters.payload_mass = v.parameters.payload_inertia = 0.0;
        ASSERT_SAME(0.0, rp_plant_grasp_at_rest(&v.parameters, v.q, v.dq, after));
        ASSERT_SAME(v.dq[0], after[0]);
        ASSERT_SAME(v.dq[1], after[1]);
    }
}

/* update: the velocities jump and the loss is summed up, once. */
static void test_update_grasps_once(void) {
    next_sample();
    v.parameters.grasp = RP_PLANT_AT_REST;
    v.parameters.payload_mass = 1.0;
    v.payload_attached = 0;
    v.modes.payload = RP_PLANT_RELEASED;
    const struct rp_plant_values before = v;
    const double loss = rp_plant_grasp_at_rest(&v.parameters, v.q, v.dq, after);
    TEST_ASSERT_TRUE(loss > 0.0);
    v.payload_attached = 1;
    for (int n = 0; n < 2; n++) {
        plant_test_update(&v, -1);
        TEST_ASSERT_EQUAL_INT(RP_PLANT_ATTACHED, v.modes.payload);
        for (int i = 0; i < 2; i++) {
            ASSERT_SAME(after[i], v.dq[i]);
            ASSERT_SAME(before.q[i], v.q[i]);
        }
        ASSERT_SAME(loss, v.sums.grasp_loss);
    }
    v.payload_attached = 0;
    plant_test_update(&v, -1);
    TEST_ASSERT_EQUAL_INT(RP_PLANT_RELEASED, v.modes.payload);
    ASSERT_SAME(after[0], v.dq[0]);
    ASSERT_SAME(after[1], v.dq[1]);
    ASSERT_SAME(loss, v.sums.grasp_loss);
}

/* By choice; before the first event, as the payload then belongs to link 2; and where parameters
 * change while it is attached, as those of the arm. */
static void test_where_velocities_stay(void) {
    const struct {
        int grasp, mode;
        double added; /* kg */
    } cases[] = {{RP_PLANT_KEEP_VELOCITY, RP_PLANT_RELEASED, 0.0},
                 {RP_PLANT_AT_REST, RP_PLANT_UNDECIDED, 0.0},
                 {RP_PLANT_AT_REST, RP_PLANT_ATTACHED, 2.0}};
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        next_sample();
        v.parameters.grasp = cases[n].grasp;
        v.modes.payload = cases[n].mode;
        v.payload_attached = 1;
        v.parameters.payload_mass += cases[n].added;
        v.parameters.payload_x += 0.125 * cases[n].added;
        const struct rp_plant_values before = v;
        plant_test_update(&v, -1);
        TEST_ASSERT_EQUAL_INT(RP_PLANT_ATTACHED, v.modes.payload);
        ASSERT_SAME(before.dq[0], v.dq[0]);
        ASSERT_SAME(before.dq[1], v.dq[1]);
        ASSERT_SAME(0.0, v.sums.grasp_loss);
    }
}
