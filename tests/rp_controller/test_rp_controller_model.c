/* The controller as the instance runs it. Events of the sampled form: the payload, rounding of
 * their times, which saved ones are possible; the Jacobian where an effort is at its limit; what is
 * refused. test_controller.py runs samples in the FMU, against the law in fractions. */
#include "last_text.h"
#include "model_test.h"
#include "rp_controller_events.h"
#include "rp_controller_law.h"
#include "rp_test_support.h"

#include <math.h>
#include <string.h>
#include <unity.h>

static struct rp_controller_values v;

static enum status begin(double t) {
    const struct event end_of_initialization = {.t = t};
    return rp_controller_events.update(&v, &end_of_initialization);
}

static double next_time(void) {
    return rp_controller_events.next_time(&v);
}

/* The next event, with the time that steps give: up to rounding. */
static void pass_event(void) {
    const struct event event = {.t = next_time(), .is_timed = true};
    ASSERT_OK(rp_controller_events.update(&v, &event));
}

static double effort(void) {
    ASSERT_OK(rp_controller_model.outputs(&v, 0.0));
    return v.effort[0];
}

/* PD without gains: the effort is the integral part, which grows by the error. */
void setUp(void) {
    memset(&v, 0, sizeof v);
    struct rp_controller_parameters *p = &v.parameters;
    p->mode = RP_CONTROLLER_PD;
    p->tracking_time = 1.0;
    for (int i = 0; i < 2; i++) {
        p->inertia[i] = 1.0;
        p->Ki[i] = 1.0;
        p->limit[i] = 1e6;
        v.inputs.q_ref[i] = 1.0;
    }
}

/* With the arm level and nothing else to do, the torque of the payload is its weight at L. */
static void test_a_sample_knows_the_payload(void) {
    double torque[2];
    for (int attached = 0; attached < 2; attached++) {
        setUp();
        struct rp_controller_parameters *p = &v.parameters;
        p->mode = RP_CONTROLLER_PD_GRAVITY;
        p->arm = (struct arm_parameters){.m1 = 2.0, .m2 = 1.0, .l1 = 0.5, .lc1 = 0.25, .g = 9.81};
        p->payload_mass = 1.5;
        p->sample_time = 0.25;
        p->Ki[0] = p->Ki[1] = v.inputs.q_ref[0] = 0.0;
        v.inputs.q_ref[1] = v.inputs.q[1] = 0.2;
        v.payload_attached = attached;
        ASSERT_OK(begin(0.0));
        pass_event();
        torque[attached] = effort();
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-14 * torque[0], 2.0 * 9.81 * 0.25 + 1.0 * 9.81 * 0.7, torque[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-14 * torque[1], 1.5 * 9.81 * 0.7, torque[1] - torque[0]);
}

/* After each sample k at 0.3 s + 0.1 s k the events until the next one, of which there may be none;
 * returns how often rounding has brought the sum of both times behind that. */
static int count_late_sums(double delay, int most_between) {
    int late = 0;
    v.parameters.sample_time = 0.1;
    v.parameters.delay = delay;
    ASSERT_OK(begin(0.3));
    for (int k = 1; k < 500; k++) {
        int between = 0;
        while (next_time() < 0.3 + k * 0.1) {
            pass_event();
            between++;
        }
        TEST_ASSERT_TRUE(between <= most_between);
        TEST_ASSERT_TRUE(next_time() == 0.3 + k * 0.1);
        pass_event();
        TEST_ASSERT_TRUE(v.samples.taken == k + 1 && v.samples.shown == k);
        late += (0.3 + k * 0.1) + delay > 0.3 + (k + 1) * 0.1;
    }
    return late;
}

static void test_efforts_do_not_wait_longer_than_for_the_next_sample(void) {
    TEST_ASSERT_TRUE(count_late_sums(0.1, 0) > 10);
    setUp();
    TEST_ASSERT_TRUE(count_late_sums(nextafter(0.1, 0.0), 1) > 10);
}

static void test_the_continuous_form_has_no_events(void) {
    ASSERT_OK(begin(0.0));
    TEST_ASSERT_TRUE(next_time() == INFINITY);
    TEST_ASSERT_FALSE(rp_controller_events.is_at_rest(&v));
    TEST_ASSERT_TRUE(rp_controller_events.modes_are_possible(&v, true));
    v.form = RP_CONTROLLER_SAMPLED;
    TEST_ASSERT_FALSE(rp_controller_events.modes_are_possible(&v, true));
}

/* A sample that cannot be computed leaves all as it was. */
static void test_a_sample_that_is_not_finite_is_refused(void) {
    v.parameters.sample_time = 0.25;
    ASSERT_OK(begin(0.0));
    const struct rp_controller_values before = v;
    v.parameters.Kp[1] = 1e308;
    v.inputs.q_ref[1] = 10.0;
    const struct event event = {.t = 0.25, .is_timed = true};
    TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE, rp_controller_events.update(&v, &event));
    TEST_ASSERT_EQUAL_MEMORY(&before.samples, &v.samples, sizeof v.samples);
    TEST_ASSERT_TRUE(v.integral[0] == before.integral[0]);
}

/* Also where only the rate of the integral part is. */
static void test_an_integral_that_is_not_finite_is_refused(void) {
    v.parameters.sample_time = 0.25;
    ASSERT_OK(begin(0.0));
    v.parameters.Ki[0] = 10.0;
    v.inputs.q_ref[0] = 1e308;
    const struct event event = {.t = 0.25, .is_timed = true};
    TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE, rp_controller_events.update(&v, &event));
    TEST_ASSERT_TRUE(v.integral[0] == 0.0);
}

static void test_saved_states_that_cannot_be_are_refused(void) {
    v.parameters.sample_time = 0.25;
    TEST_ASSERT_FALSE(rp_controller_events.modes_are_possible(&v, true));
    ASSERT_OK(begin(0.0));
    const double counts[][3] = {
        // taken, shown, whether it can be
        {1, 1, 1}, {2, 1, 1},   {2, 2, 1},   {1e15, 1e15, 1}, {0, 0, 0},   {1, 0, 0},   {1, 2, 0},
        {3, 1, 0}, {1.5, 1, 0}, {2, 1.5, 0}, {-1, -1, 0},     {NAN, 1, 0}, {2, NAN, 0}, {1, -1, 0},
    };
    for (size_t i = 0; i < sizeof counts / sizeof counts[0]; i++) {
        v.samples.taken = counts[i][0];
        v.samples.shown = counts[i][1];
        TEST_ASSERT_EQUAL_INT(counts[i][2] != 0.0,
                              rp_controller_events.modes_are_possible(&v, true));
    }
    v.samples.taken = v.samples.shown = 1.0;
    for (int form = -1; form <= 3; form++) {
        v.form = form;
        TEST_ASSERT_EQUAL_INT(form == RP_CONTROLLER_SAMPLED,
                              rp_controller_events.modes_are_possible(&v, true));
    }
}

/* ---- Parameters ------------------------------------------------------------------------------ */

/* All that is real: from arm to payload_z, and from the inputs to the integral part. */
enum {
    PARAMETERS = offsetof(struct rp_controller_parameters, sample_time) / sizeof(double),
    INPUTS = offsetof(struct rp_controller_values, inputs) / sizeof(double),
    KNOWNS = offsetof(struct rp_controller_values, payload_attached) / sizeof(double),
};

static union {
    struct rp_controller_values v;
    double all[KNOWNS];
} at;
static struct rp_test_random random_source = {7};

static void next_point(int mode) {
    memset(&at, 0, sizeof at);
    for (int i = 0; i < KNOWNS; i++) {
        if (i < PARAMETERS || i >= INPUTS) {
            at.all[i] = rp_test_uniform(&random_source, 0.5, 2.0);
        }
    }
    at.v.parameters.mode = mode;
    // efforts of both signs
    const double side = rp_test_uniform(&random_source, -1.0, 1.0) < 0.0 ? -64.0 : 64.0;
    at.v.integral[0] += side;
    at.v.integral[1] -= side;
}

/* ---- Jacobian ------------------------------------------------------------------------------- */

static void jacobian(double J[2][2]) {
    memset(J, 0xff, sizeof(double[2][2]));
    ASSERT_OK(rp_controller_model.jacobian(&at, 3.0, at.v.integral, at.v.inputs.q_ref, J[0]));
}

/* Efforts below their limits and beyond them: test_every_model.c. */
static void test_an_effort_at_its_limit_counts_as_beyond(void) {
    for (int n = 0; n < 24; n++) {
        double J[2][2], beyond[2][2];
        next_point(RP_CONTROLLER_PD + n % 3);
        at.v.form = RP_CONTROLLER_CONTINUOUS;
        double *limit = at.v.parameters.limit;
        law_unlimited(&at.v.parameters, false, &at.v.inputs, at.v.integral, limit);
        for (int i = 0; i < 2; i++) {
            limit[i] = fabs(limit[i]);
        }
        jacobian(J);
        limit[0] *= 0.5;
        limit[1] *= 0.5;
        jacobian(beyond);
        TEST_ASSERT_EQUAL_MEMORY(beyond, J, sizeof J);
        TEST_ASSERT_TRUE(J[0][0] < 0.0 && J[1][1] < 0.0);
    }
}

/* ---- What is refused ------------------------------------------------------------------------ */

static void assert_refused(const char *expected) {
    model_test_refused(&rp_controller_model, &at, expected);
}

static void test_times_that_do_not_fit_are_refused(void) {
    next_point(RP_CONTROLLER_PD);
    struct rp_controller_parameters *p = &at.v.parameters;
    p->delay = 0.0625;
    assert_refused("delay = 0.0625 s is refused: it must not be above sample_time = 0 s");
    p->sample_time = 0.03125;
    assert_refused("delay = 0.0625 s is refused: it must not be above sample_time = 0.03125 s");
    p->sample_time = 0.999e-6;
    assert_refused("sample_time = 9.99e-07 s is refused: it must be 0, for a continuous law, or at "
                   "least 1e-06 s");
    p->sample_time = p->delay = 1e-6;
    model_test_accepted(&rp_controller_model, &at);
}

static void test_an_arm_without_inertia_is_refused(void) {
    next_point(RP_CONTROLLER_PD);
    struct arm_parameters *arm = &at.v.parameters.arm;
    model_test_accepted(&rp_controller_model, &at);
    arm->m1 = 2.0;
    arm->lc1 = arm->I1z = arm->I2z = 0.0;
    assert_refused("the inertia m1 lc1^2 + I1z + I2z = 0 is refused: it must be above 0 "
                   "(m1 = 2, lc1 = 0, I1z = 0, I2z = 0)");
}
