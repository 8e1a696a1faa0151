/* The mirror image in the vertical: q1 -> pi - q1, a -> -a. What turns or points sideways changes
 * its sign, what points along the slide does not. */
#include "plant_test_support.h"
#include "unity.h"

#include <math.h>
#include <string.h>

static struct rp_test_random random_source;

void setUp(void) {
    random_source.state = 59;
}

static int mirrored_mode(int mode) {
    return mode == RP_PLANT_FREE ? mode : -mode;
}

static void mirror(const struct rp_plant_values *v, struct rp_plant_values *image) {
    struct rp_plant_parameters *p = &image->parameters;
    *image = *v;
    p->arm.a = -v->parameters.arm.a;
    p->payload_x = -v->parameters.payload_x;
    p->lower[0] = RP_TEST_PI - v->parameters.upper[0];
    p->upper[0] = RP_TEST_PI - v->parameters.lower[0];
    image->inputs.tau[0] = -v->inputs.tau[0];
    image->inputs.wrench[0] = -v->inputs.wrench[0];
    image->inputs.wrench[2] = -v->inputs.wrench[2];
    image->q[0] = RP_TEST_PI - v->q[0];
    image->dq[0] = -v->dq[0];
    image->modes.joint[0] = mirrored_mode(v->modes.joint[0]);
}

static void assert_images(const struct rp_plant_values *v, const struct rp_plant_values *image) {
    const double scale = 1e-12 * (1000.0 + fabs(v->ddq[0]) + fabs(v->ddq[1]));
    for (int i = 0; i < 2; i++) {
        const double sign = i == 0 ? -1.0 : 1.0;
        ASSERT_CLOSE(sign * v->ddq[i], image->ddq[i], scale);
        ASSERT_CLOSE(sign * v->friction[i], image->friction[i], scale);
        ASSERT_CLOSE(sign * v->stop_force[i], image->stop_force[i], scale);
        ASSERT_CLOSE(sign * v->ee_position[i], image->ee_position[i], scale);
        ASSERT_CLOSE(sign * v->ee_acceleration[i], image->ee_acceleration[i], 100 * scale);
        ASSERT_CLOSE(sign * v->dq[i], image->dq[i], scale);
        ASSERT_CLOSE(sign * v->sums.stop_impulse[i], image->sums.stop_impulse[i], scale);
    }
    ASSERT_CLOSE(v->total_energy, image->total_energy, 10 * scale);
    ASSERT_CLOSE(v->friction_power, image->friction_power, 10 * scale);
    ASSERT_CLOSE(-v->loads.f2[0], image->loads.f2[0], 100 * scale);
    ASSERT_CLOSE(v->loads.f2[2], image->loads.f2[2], 100 * scale);
    ASSERT_CLOSE(-v->loads.tau2[1], image->loads.tau2[1], 100 * scale);
    ASSERT_CLOSE(-v->loads.tau1[1], image->loads.tau1[1], 100 * scale);
    ASSERT_CLOSE(v->sums.impact_loss, image->sums.impact_loss, 10 * scale);
    ASSERT_CLOSE(v->sums.grasp_loss, image->sums.grasp_loss, 10 * scale);
    TEST_ASSERT_EQUAL_INT(mirrored_mode(v->modes.joint[0]), image->modes.joint[0]);
    TEST_ASSERT_EQUAL_INT(v->modes.joint[1], image->modes.joint[1]);
}

static void test_motion_of_the_image_is_the_image_of_the_motion(void) {
    for (int n = 0; n < 10 * RP_TEST_SAMPLES; n++) {
        struct rp_plant_values v;
        struct rp_plant_values image;
        plant_test_random_plant(&random_source, &v);
        v.parameters.arm.I1z += 0.5;
        mirror(&v, &image);
        plant_test_outputs(&v);
        plant_test_outputs(&image);
        assert_images(&v, &image);
    }
}

/* Impacts, grasps and decisions at rest are mirrored, too. */
static void test_events_of_the_image_are_images(void) {
    for (int n = 0; n < 10 * RP_TEST_SAMPLES; n++) {
        struct rp_plant_values v;
        struct rp_plant_values image;
        plant_test_random_plant(&random_source, &v);
        struct rp_plant_parameters *p = &v.parameters;
        p->arm.I1z += 0.5;
        p->grasp = RP_PLANT_AT_REST;
        v.modes.payload = RP_PLANT_RELEASED;
        int indicator = -1;
        for (int i = 0; i < 2; i++) {
            const uint64_t bits = rp_test_random_bits(&random_source);
            p->restitution[i] = rp_test_uniform(&random_source, 0.0, 1.0);
            p->stops[i] = RP_PLANT_STOPS_RIGID;
            p->lower[i] = v.q[i] - 1.0;
            p->upper[i] = v.q[i] + 1.0;
            v.modes.joint[i] = RP_PLANT_FREE;
            if (bits % 3 == 0) {
                v.dq[i] = 0.0;
            } else if (bits % 3 == 1 && indicator < 0) {
                // at the stop, to rounding
                indicator = 4 * i + (v.dq[i] < 0.0 ? 2 : 3);
                p->lower[i] = v.q[i] - (v.dq[i] < 0.0 ? 1e-14 : 1.0);
                p->upper[i] = v.q[i] + (v.dq[i] < 0.0 ? 1.0 : 1e-14);
            }
        }
        mirror(&v, &image);
        const int mirrored = indicator == 2 ? 3 : indicator == 3 ? 2 : indicator;
        plant_test_update(&v, indicator);
        plant_test_update(&image, mirrored);
        plant_test_outputs(&v);
        plant_test_outputs(&image);
        assert_images(&v, &image);
    }
}
