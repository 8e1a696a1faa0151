/* The events of the sampled form: the payload, rounding of their times, what is refused, which
 * saved ones are possible. test_controller_samples.py runs them in the FMU, against the law in
 * fractions. */
#include "last_text.h"
#include "rp_controller_events.h"

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
        p->arm = (struct rp_parameters){.m1 = 2.0, .m2 = 1.0, .l1 = 0.5, .lc1 = 0.25, .g = 9.81};
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
