/* Counts and noise of the encoder; the sensor as the instance runs it: what is shown at the start
 * and beyond all counts, which modes are refused. test_sensor.py compares samples, latency and
 * noise with a sensor in fractions, test_rp_sensor_masters.c the times of ticks with whole numbers.
 */
#include "last_text.h"
#include "model_test.h"
#include "rp_sensor_model.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

/* ---- Counts: the nearest multiple of the resolution, of two the upper one -------------------- */

static void assert_counts(int expected, double position, double resolution) {
    TEST_ASSERT_EQUAL_INT(expected, rp_sensor_count(position, resolution));
}

static void test_counts_of_multiples(void) {
    for (int n = -1000; n <= 1000; n++) {
        assert_counts(n, n * 0.125, 0.125);
        assert_counts(n, n * 1e-12, 1e-12);
        assert_counts(n, n * 3e5, 3e5);
    }
}

/* With a resolution of 1/8 all quotients are exact. */
static void test_counts_change_halfway(void) {
    for (int n = -1000; n <= 1000; n++) {
        const double edge = (n + 0.5) * 0.125;
        assert_counts(n + 1, edge, 0.125);
        assert_counts(n, nextafter(edge, -INFINITY), 0.125);
        assert_counts(n + 1, nextafter(edge, INFINITY), 0.125);
    }
    assert_counts(0, 0.49999999999999994, 1.0); // the sum with 1/2 would be 1
    assert_counts(0, -0.5, 1.0);
    assert_counts(0, -0.0, 1e-6);
    assert_counts(0, DBL_TRUE_MIN, 1e-12);
    assert_counts(0, -DBL_TRUE_MIN, 1e-12);
    assert_counts(-1, nextafter(-0.5, -INFINITY), 1.0);
}

static void test_the_counter_stops_at_its_ends(void) {
    assert_counts(2147483646, 2147483646.25, 1.0);
    assert_counts(2147483647, 2147483646.5, 1.0);
    assert_counts(2147483647, 2147483647.75, 1.0);
    assert_counts(2147483647, 1e300, 1e-12);
    assert_counts(2147483647, INFINITY, 1.0);
    assert_counts(-2147483646, -2147483646.5, 1.0);
    assert_counts(-2147483647, -2147483646.75, 1.0);
    assert_counts(-2147483647, -2147483647.75, 1.0);
    assert_counts(-2147483647, -2147483648.0, 1.0);
    assert_counts(-2147483647, -1e300, 1e-12);
    assert_counts(-2147483647, -INFINITY, 1.0);
}

/* ---- Noise: numbers of splitmix64 -------------------------------------------------------------
 */

/* The numbers that the generator gives from the state 1234567 on, in its author's C program. */
static void test_the_hash_is_splitmix64(void) {
    static const uint64_t expected[] = {
        UINT64_C(6457827717110365317), UINT64_C(3203168211198807973), UINT64_C(9817491932198370423),
        UINT64_C(4593380528125082431), UINT64_C(16408922859458223821)};
    for (uint64_t n = 0; n < 5; n++) {
        TEST_ASSERT_EQUAL_UINT64(expected[n], rp_sensor_hash(1234567, n));
    }
}

/* The start is the finalizer's word of seed and joint; each tick takes the next two numbers. */
static void test_the_noise_is_made_of_two_numbers_of_the_hash(void) {
    const int seeds[] = {0, 20, -20, INT32_MAX, INT32_MIN};
    for (int n = 0; n < 10; n++) {
        const int seed = seeds[n / 2], joint = n % 2;
        const uint64_t word = ((uint64_t)(uint32_t)seed << 32) + (uint64_t)joint;
        const uint64_t state = rp_sensor_hash(word - UINT64_C(0x9E3779B97F4A7C15), 0);
        for (uint64_t k = 0; k < 1000; k++) {
            const double u1 = (double)((rp_sensor_hash(state, 2 * k) >> 11) + 1) * 0x1p-53;
            const double u2 = (double)(rp_sensor_hash(state, 2 * k + 1) >> 11) * 0x1p-53;
            const double expected = sqrt(-2.0 * log(u1)) * cos(2.0 * acos(-1.0) * u2);
            TEST_ASSERT_DOUBLE_WITHIN(1e-14, expected, rp_sensor_noise(seed, joint, k));
        }
    }
}

/* Every tick that a double counts has a noise, which the 53 bits of the hash bound. */
static void test_noise_is_bounded(void) {
    const double bound = sqrt(2.0 * 53.0 * log(2.0));
    for (int n = 0; n < 53; n++) {
        const double z = rp_sensor_noise(INT32_MIN, 1, (uint64_t)1 << n);
        TEST_ASSERT_TRUE(fabs(z) <= bound);
    }
}

/* ---- Model ---------------------------------------------------------------------------------- */

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

/* ---- Samples -------------------------------------------------------------------------------- */

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
