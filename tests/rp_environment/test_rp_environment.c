/* The wall: its force against formulas written out here, power, no adhesion, symmetry under turns,
 * derivatives, refusals. */
#include "last_text.h"
#include "model_test.h"
#include "rp_environment_model.h"
#include "rp_test_support.h"

#include <float.h>
#include <math.h>
#include <string.h>
#include <unity.h>

static const struct model *const model = &rp_environment_model;
static struct rp_environment_values v;
static struct rp_test_random random_source;

void setUp(void) {
    random_source.state = 11;
    v = (struct rp_environment_values){
        .parameters = {.stiffness = 2000.0, .damping = 30.0, .position = -0.25, .tip_z = 0.125},
    };
}
static double uniform(double low, double high) {
    return rp_test_uniform(&random_source, low, high);
}

static void outputs(void) {
    ASSERT_OK(model->outputs(&v, 0.0));
}

/* A random wall, and a tip at the depth given, which moves at random. */
static void next_at_depth(double depth) {
    struct rp_environment_parameters *p = &v.parameters;
    p->stiffness = uniform(500.0, 2000.0);
    p->damping = uniform(1.0, 50.0);
    p->position = uniform(-0.5, 0.5);
    p->angle = uniform(-4.0, 4.0);
    p->tip_x = uniform(-0.25, 0.25);
    p->tip_z = uniform(-0.25, 0.25);
    v.inputs.angle = uniform(-4.0, 4.0);
    v.inputs.rate = uniform(-2.0, 2.0);
    const double along = uniform(-1.0, 1.0);
    const double normal = p->position - depth;
    const double c = cos(v.inputs.angle);
    const double s = sin(v.inputs.angle);
    const double n[2] = {cos(p->angle), sin(p->angle)};
    v.inputs.position[0] = normal * n[0] - along * n[1] - (p->tip_z * c - p->tip_x * s);
    v.inputs.position[1] = normal * n[1] + along * n[0] - (p->tip_z * s + p->tip_x * c);
    v.inputs.velocity[0] = uniform(-1.0, 1.0);
    v.inputs.velocity[1] = uniform(-1.0, 1.0);
}

/* ---- The force ------------------------------------------------------------------------------ */

/* Normal x0, slide along x0: one line of arithmetic, exact in doubles. */
static void test_a_tip_that_moves_along_the_normal(void) {
    v.inputs.position[0] = -0.5; // the tip: -0.375, by 0.125 in the wall
    v.inputs.velocity[0] = -0.5;
    v.inputs.velocity[1] = 8.0; // no friction along the wall
    outputs();
    TEST_ASSERT_TRUE(v.penetration == 0.125);
    TEST_ASSERT_TRUE(v.force == 2000.0 * 0.125 + 30.0 * 0.5);
    TEST_ASSERT_TRUE(v.wrench[0] == v.force && v.wrench[1] == 0.0 && v.wrench[2] == 0.0);
}

/* The arm's slide upwards: x2 points to -x0, z2 to y0. */
static void test_a_tip_beside_the_end_effector_takes_part_in_its_turn(void) {
    v.parameters.tip_x = 0.25;
    v.inputs.angle = RP_TEST_PI / 2.0;
    v.inputs.rate = 2.0;
    v.inputs.position[0] = -0.125; // the tip: (-0.375, 0.125)
    outputs();
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0.125, v.penetration);
    // from the end effector (-0.25, 0.125): turned by 2 rad/s, vx = -0.25 into the wall
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 2000.0 * 0.125 + 30.0 * 0.25, v.force);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.125 * v.force, v.wrench[2]);
}

static void test_force_and_moment_are_those_of_the_formulas(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        next_at_depth(uniform(0.1, 0.5));
        const struct rp_environment_parameters *p = &v.parameters;
        const struct rp_environment_inputs *in = &v.inputs;
        outputs();

        // tip and normal by angles: the tip is at the distance r in the direction beta
        const double r = hypot(p->tip_x, p->tip_z);
        const double beta = in->angle + atan2(p->tip_x, p->tip_z);
        const double between = beta - p->angle;
        const double depth = p->position - in->position[0] * cos(p->angle) -
                             in->position[1] * sin(p->angle) - r * cos(between);
        const double speed = in->velocity[0] * cos(p->angle) + in->velocity[1] * sin(p->angle) -
                             in->rate * r * sin(between);
        const double force = fmax(p->stiffness * depth - p->damping * speed, 0.0);
        const double bound = 64.0 * DBL_EPSILON;
        const double size = 4.0 * p->stiffness + 4.0 * p->damping;
        ASSERT_CLOSE(depth, v.penetration, 4.0 * bound);
        ASSERT_CLOSE(force, v.force, size * bound);
        ASSERT_CLOSE(force * cos(p->angle), v.wrench[0], size * bound);
        ASSERT_CLOSE(force * sin(p->angle), v.wrench[1], size * bound);
        ASSERT_CLOSE(-force * r * sin(between), v.wrench[2], size * bound);
    }
}

/* The wrench about the origin of frame 2 does the work of the force at the tip. */
static void test_power_of_the_wrench_is_that_of_the_force_at_the_tip(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        next_at_depth(uniform(0.1, 0.5));
        const struct rp_environment_parameters *p = &v.parameters;
        const struct rp_environment_inputs *in = &v.inputs;
        outputs();
        const double power =
            v.wrench[0] * in->velocity[0] + v.wrench[1] * in->velocity[1] + v.wrench[2] * in->rate;
        // the speed of the tip along the normal by a difference of its depth over 2 h
        const double h = 1.0 / 1024.0;
        double depth[2];
        const struct rp_environment_values now = v;
        for (int k = 0; k < 2; k++) {
            const double dt = k == 0 ? -h : h;
            v.inputs.position[0] = now.inputs.position[0] + dt * now.inputs.velocity[0];
            v.inputs.position[1] = now.inputs.position[1] + dt * now.inputs.velocity[1];
            v.inputs.angle = now.inputs.angle + dt * now.inputs.rate;
            outputs();
            depth[k] = v.penetration;
            v = now;
        }
        const double speed = -(depth[1] - depth[0]) / (2.0 * h);
        // truncation: rate^3 r h^2 / 6
        ASSERT_CLOSE(v.force * speed, power, 1e-6 * (p->stiffness + p->damping));
    }
}

/* ---- Touch and release ---------------------------------------------------------------------- */

static void test_nothing_acts_outside_of_the_wall(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        next_at_depth(-uniform(1e-5, 0.5));
        v.inputs.velocity[0] *= 1e3;
        v.inputs.velocity[1] *= 1e3;
        outputs();
        TEST_ASSERT_TRUE(v.penetration == 0.0 && v.force == 0.0);
        for (int i = 0; i < 3; i++) {
            TEST_ASSERT_TRUE(v.wrench[i] == 0.0);
        }
    }
}

/* A tip on the surface is outside; just below it the damping acts in full. */
static void test_contact_begins_below_the_surface(void) {
    v.inputs.velocity[0] = -1.0;
    v.inputs.position[0] = -0.375; // the tip: -0.25
    outputs();
    TEST_ASSERT_TRUE(v.penetration == 0.0 && v.force == 0.0);
    v.inputs.position[0] = nextafter(-0.375, -1.0);
    outputs();
    TEST_ASSERT_TRUE(v.penetration > 0.0 && v.penetration < 1e-15);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 30.0, v.force);
}

/* On the way out the force ends where damping outweighs the spring, within the wall. */
static void test_the_wall_never_pulls(void) {
    const double limit = 2000.0 * 0.0625 / 30.0; // m/s, at a depth of 1/16 m
    v.inputs.position[0] = -0.4375;
    v.inputs.velocity[0] = 0.999 * limit;
    outputs();
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.001 * 2000.0 * 0.0625, v.force);
    v.inputs.velocity[0] = 1.001 * limit;
    outputs();
    TEST_ASSERT_TRUE(v.penetration == 0.0625 && v.force == 0.0 && v.wrench[0] == 0.0);
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        next_at_depth(uniform(-0.05, 0.05));
        outputs();
        TEST_ASSERT_TRUE(v.force >= 0.0 && v.penetration >= 0.0);
    }
}

static void test_a_wall_without_stiffness_and_damping_is_felt_by_nobody(void) {
    next_at_depth(0.25);
    v.parameters.stiffness = v.parameters.damping = 0.0;
    outputs();
    TEST_ASSERT_TRUE(v.penetration > 0.2 && v.force == 0.0);
}

/* The whole scene turned about the origin of frame 0: the force turns with it. */
static void test_a_turned_wall_pushes_a_turned_tip_alike(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        next_at_depth(uniform(0.1, 0.5));
        outputs();
        const struct rp_environment_values one = v;
        const double turn = uniform(-3.0, 3.0);
        const double c = cos(turn);
        const double s = sin(turn);
        v.parameters.angle += turn;
        v.inputs.angle += turn;
        v.inputs.position[0] = c * one.inputs.position[0] - s * one.inputs.position[1];
        v.inputs.position[1] = s * one.inputs.position[0] + c * one.inputs.position[1];
        v.inputs.velocity[0] = c * one.inputs.velocity[0] - s * one.inputs.velocity[1];
        v.inputs.velocity[1] = s * one.inputs.velocity[0] + c * one.inputs.velocity[1];
        outputs();
        const double bound = 1e-11;
        ASSERT_CLOSE(one.force, v.force, bound);
        ASSERT_CLOSE(c * one.wrench[0] - s * one.wrench[1], v.wrench[0], bound);
        ASSERT_CLOSE(s * one.wrench[0] + c * one.wrench[1], v.wrench[1], bound);
        ASSERT_CLOSE(one.wrench[2], v.wrench[2], bound);
    }
}

/* A motion that overflows is not taken for one outside of the wall. */
static void test_what_is_no_number_stays_so(void) {
    v.inputs.position[0] = NAN;
    outputs();
    TEST_ASSERT_TRUE(isnan(v.penetration) && isnan(v.force) && isnan(v.wrench[0]));
    v.inputs.position[0] = -1.0;
    v.inputs.velocity[0] = NAN;
    outputs();
    TEST_ASSERT_TRUE(v.penetration > 0.0 && isnan(v.force));
}

/* ---- Derivatives ---------------------------------------------------------------------------- */

enum {
    CALCULATED = offsetof(struct rp_environment_values, wrench) / sizeof(double),
    DOUBLES = sizeof(struct rp_environment_values) / sizeof(double),
};

union point {
    struct rp_environment_values v;
    double all[DOUBLES];
};

static union point at, first, second;

static double field_at(const void *field, double t) {
    union point moved = at;
    for (int i = 0; i < CALCULATED; i++) {
        moved.all[i] += t * first.all[i] + 0.5 * t * t * second.all[i];
    }
    ASSERT_OK(model->outputs(&moved.v, t));
    return moved.all[*(const int *)field];
}

static void next_curve(double depth, double speed) {
    next_at_depth(depth);
    v.inputs.velocity[0] += speed * cos(v.parameters.angle);
    v.inputs.velocity[1] += speed * sin(v.parameters.angle);
    at.v = v;
    memset(&first, 0xff, sizeof first); // NaN
    memset(&second, 0xff, sizeof second);
    for (int i = 0; i < CALCULATED; i++) {
        first.all[i] = uniform(-0.5, 0.5);
        second.all[i] = uniform(-0.5, 0.5);
    }
}

static void test_derivatives_along_curves_are_those_of_the_fields(void) {
    const double h = 1.0 / 256.0;
    for (int n = 0; n < 200; n++) {
        // pressed; on the way out, where the wall does not pull; outside
        const double depth = n % 3 == 2 ? -0.5 : 0.5;
        next_curve(depth, n % 3 == 1 ? 4096.0 : 0.0);
        ASSERT_OK(model->propagate(&at.v, 0.0, 1.0, &first.v, &second.v));
        for (int field = CALCULATED; field < DOUBLES; field++) {
            const double scale = 1e4;
            ASSERT_CLOSE(rp_test_derivative(field_at, &field, 0.0, h), first.all[field],
                         1e-11 * scale);
            ASSERT_CLOSE(rp_test_second_derivative(field_at, &field, 0.0, h), second.all[field],
                         1e-9 * scale);
        }
        TEST_ASSERT_TRUE((first.v.force != 0.0) == (n % 3 == 0));
        TEST_ASSERT_TRUE((first.v.penetration != 0.0) == (n % 3 != 2));
    }
}

static void test_first_derivatives_do_not_need_the_second(void) {
    for (int n = 0; n < 20; n++) {
        next_curve(0.5, 0.0);
        union point only = first;
        ASSERT_OK(model->propagate(&at.v, 0.0, 1.0, &first.v, &second.v));
        ASSERT_OK(model->propagate(&at.v, 0.0, 1.0, &only.v, NULL));
        TEST_ASSERT_EQUAL_MEMORY(&first, &only, sizeof only);
    }
}

static void test_there_is_no_state(void) {
    TEST_ASSERT_EQUAL_UINT64(0, model->states.size);
    ASSERT_OK(model->right_hand_side(&v, 0.0, NULL, NULL, NULL));
}

/* ---- What is refused ------------------------------------------------------------------------ */

static void test_values_out_of_range_are_refused_with_the_value(void) {
    struct rp_environment_parameters *p = &v.parameters;
    const struct {
        double *parameter;
        double value;
        const char *text;
    } cases[] = {
        {&p->stiffness, -1.5, "stiffness = -1.5 is refused: it must be finite and not below 0"},
        {&p->stiffness, INFINITY, "stiffness = inf is refused: it must be finite and not below 0"},
        {&p->damping, -0.25, "damping = -0.25 is refused: it must be finite and not below 0"},
        {&p->position, INFINITY, "position = inf is refused: it must be finite"},
        {&p->angle, -INFINITY, "angle = -inf is refused: it must be finite"},
        {&p->tip_x, INFINITY, "tip_x = inf is refused: it must be finite"},
        {&p->tip_z, INFINITY, "tip_z = inf is refused: it must be finite"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const double before = *cases[i].parameter;
        model_test_accepted(model, &v);
        *cases[i].parameter = cases[i].value;
        model_test_refused(model, &v, cases[i].text);
        *cases[i].parameter = before;
    }
    p->stiffness = p->damping = 0.0;
    model_test_accepted(model, &v);
}
