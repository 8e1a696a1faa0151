/* The sensor as the instance runs it: ticks, latency, what is shown, which modes are refused. */
#include "last_text.h"
#include "model_test.h"
#include "rp_sensor_model.h"

#include <math.h>
#include <string.h>
#include <unity.h>

static const struct model_events *events;
static struct rp_sensor_values v;

void setUp(void) {
    events = rp_sensor_model.events;
    memset(&v, 0, sizeof v);
    v.parameters = (struct rp_sensor_parameters){
        .sample_time = 0.001, .resolution = {0.25, 0.5}, .noise = {0.0, 0.0}};
}

static enum status update(double t, bool is_timed) {
    const struct event event = {.t = t, .is_timed = is_timed};
    return events->update(&v, &event);
}

static void start(double t) {
    ASSERT_OK(update(t, false));
}

static void tick(void) {
    ASSERT_OK(update(events->next_time(&v), true));
}

static void assert_shown(int counts1, int counts2) {
    ASSERT_OK(rp_sensor_model.outputs(&v, 0.0));
    TEST_ASSERT_EQUAL_INT(counts1, v.counts[0]);
    TEST_ASSERT_EQUAL_INT(counts2, v.counts[1]);
    TEST_ASSERT_EQUAL_DOUBLE(counts1 * 0.25, v.q_measured[0]);
    TEST_ASSERT_EQUAL_DOUBLE(counts2 * 0.5, v.q_measured[1]);
}

/* ---- Ticks ---------------------------------------------------------------------------------- */

/* The time is that of an integer times the sample time, rounded twice, not a sum of many. */
static void test_times_of_ticks_do_not_drift(void) {
    v.parameters.sample_time = 0.1;
    start(3.7);
    for (int k = 1; k <= 100000; k++) {
        TEST_ASSERT_EQUAL_DOUBLE(3.7 + k * 0.1, events->next_time(&v));
        tick();
    }
}

static void test_each_tick_samples_its_inputs(void) {
    v.q[0] = 1.0;
    v.q[1] = -3.0;
    start(0.0);
    assert_shown(4, -6);
    for (int k = 1; k < 500; k++) {
        v.q[0] = 0.25 * k * k;
        v.q[1] = -0.5 * k;
        tick();
        assert_shown(k * k, -k);
        const double expected =
            k == 1 ? (1.0 - 4.0) * 0.25 / 0.001 : (2.0 * k - 1.0) * 0.25 / 0.001;
        TEST_ASSERT_EQUAL_DOUBLE(expected, v.dq_measured[0]);
        TEST_ASSERT_EQUAL_DOUBLE(k == 1 ? 5.0 * 0.5 / 0.001 : -0.5 / 0.001, v.dq_measured[1]);
    }
}

static void test_what_is_no_tick_changes_nothing(void) {
    v.q[0] = 1.0;
    start(0.0);
    tick();
    const struct rp_sensor_values before = v;
    v.q[0] = 2.0;
    ASSERT_OK(update(0.0015, false));
    TEST_ASSERT_EQUAL_MEMORY(before.samples, v.samples, sizeof v.samples);
    TEST_ASSERT_EQUAL_DOUBLE(before.ticks, v.ticks);
    TEST_ASSERT_EQUAL_DOUBLE(before.start, v.start);
    assert_shown(4, 0);
}

static void test_each_sample_is_shown_after_the_latency(void) {
    for (int latency = 0; latency <= RP_SENSOR_LATENCY_MAX; latency++) {
        setUp();
        v.parameters.latency = latency;
        v.q[0] = 0.25 * 7;
        start(0.0);
        assert_shown(7, 0);
        TEST_ASSERT_EQUAL_DOUBLE(0.0, v.dq_measured[0]);
        for (int k = 1; k < 300; k++) {
            v.q[0] = 0.25 * (7 + k * k);
            tick();
            const int of = k > latency ? k - latency : 0;
            const int step = k > latency ? 2 * of - 1 : 0;
            assert_shown(7 + of * of, 0);
            TEST_ASSERT_EQUAL_DOUBLE(step * 0.25 / 0.001, v.dq_measured[0]);
        }
    }
}

/* Before the initialization ends outputs are those that the start will show. */
static void test_outputs_during_initialization(void) {
    v.parameters.noise[0] = 3.0;
    v.parameters.latency = 5;
    for (int n = 0; n < 100; n++) {
        v.q[0] = n;
        ASSERT_OK(rp_sensor_model.outputs(&v, 0.0));
        const int expected = v.counts[0];
        const struct rp_sensor_values before = v;
        start(0.0);
        assert_shown(expected, 0);
        TEST_ASSERT_EQUAL_DOUBLE(before.dq_measured[0], v.dq_measured[0]);
        v = before;
    }
}

static void test_noise_is_that_of_seed_joint_and_tick(void) {
    v.parameters.noise[0] = 100.0;
    v.parameters.noise[1] = 30.0;
    v.parameters.seed = -5;
    start(0.0);
    for (uint64_t k = 0; k < 200; k++) {
        assert_shown(rp_sensor_count(100.0 * rp_sensor_noise(-5, 0, k), 0.25),
                     rp_sensor_count(30.0 * rp_sensor_noise(-5, 1, k), 0.5));
        tick();
    }
}

static void test_rates_do_not_overflow_an_int(void) {
    v.q[0] = -1e300;
    start(0.0);
    v.q[0] = 1e300;
    tick();
    assert_shown(RP_SENSOR_COUNT_MAX, 0);
    TEST_ASSERT_EQUAL_DOUBLE(2.0 * RP_SENSOR_COUNT_MAX * 0.25 / 0.001, v.dq_measured[0]);
}

static void test_positions_that_are_not_finite_are_not_counted(void) {
    start(0.0);
    const struct rp_sensor_values before = v;
    const double positions[] = {NAN, INFINITY, -INFINITY};
    for (size_t i = 0; i < 6; i++) {
        v.q[i % 2] = positions[i / 2];
        TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE, update(0.001, true));
        v.q[i % 2] = 0.0;
        TEST_ASSERT_EQUAL_MEMORY(&before, &v, sizeof v);
    }
}

/* At least 4096 doubles lie between two ticks at the start. */
static void test_sample_times_that_the_start_swallows_are_refused(void) {
    const double limit = 0.001 * 0x1p40;
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_PARAMETERS, update(-1e300, false));
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_PARAMETERS, update(nextafter(limit, INFINITY), false));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, v.ticks);
    start(limit);
    TEST_ASSERT_TRUE(events->next_time(&v) > limit);
}

static void test_resolutions_that_give_no_finite_velocity_are_refused(void) {
    model_test_accepted(&rp_sensor_model, &v);
    v.parameters.resolution[1] = 1e295;
    model_test_accepted(&rp_sensor_model, &v);
    v.parameters.resolution[1] = 1e296;
    model_test_refused(&rp_sensor_model, &v,
                       "resolution2 = 1e+296 is refused: with sample_time = 0.001 s the velocity "
                       "of 2^32 counts in one sample time is not finite");
}

/* ---- Modes of saved states ------------------------------------------------------------------ */

static void assert_possible(bool expected) {
    TEST_ASSERT_TRUE(events->modes_are_possible(&v, false) == expected);
    TEST_ASSERT_TRUE(events->modes_are_possible(&v, true) == expected);
}

static void test_what_ticks_leave_is_possible(void) {
    v.parameters.noise[0] = 100.0;
    assert_possible(false); // no sample has been
    start(-2.0);
    for (int k = 0; k < 300; k++) {
        assert_possible(true);
        tick();
    }
    v.ticks = 0x1p53;
    assert_possible(true);
}

static void test_forged_modes_are_impossible(void) {
    const double ticks[] = {0.0, -1.0, 0.5, 3.5, 0x1p54, 1e300, INFINITY, NAN};
    v.q[0] = 3.0;
    start(0.0);
    tick();
    const struct rp_sensor_values before = v;
    for (size_t i = 0; i < sizeof ticks / sizeof ticks[0]; i++) {
        v.ticks = ticks[i];
        assert_possible(false);
    }
    v = before;
    v.samples[1][1] = INT32_MIN;
    assert_possible(false);
    v = before;
    v.ticks = 1.0; // the second sample is there before its tick
    assert_possible(false);
    v = before;
    v.samples[RP_SENSOR_SAMPLES - 1][1] = 1;
    assert_possible(false);
}
