/* Counts and noise of the encoder. The statistics of the noise are of 2^20 ticks of each joint, by
 * tests with a significance of 0.1 %; the seed is fixed. */
#include "rp_sensor.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
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

/* ---- Noise: the hash against published numbers, and statistics ------------------------------- */

enum { N = 1 << 20, CELLS = 64, SEED = 20 };

/* Two-sided quantile of the normal distribution, and upper one of chi squared with CELLS - 1
 * degrees of freedom, both at 0.1 %. */
static const double z_bound = 3.2905;
static const double chi2_bound = 103.442;

static double noise[2][N];

void suiteSetUp(void);

void suiteSetUp(void) {
    for (int i = 0; i < 2; i++) {
        for (uint64_t k = 0; k < N; k++) {
            noise[i][k] = rp_sensor_noise(SEED, i, k);
        }
    }
}

/* Returns the correlation of x and y, whose mean is 0 and variance 1. */
static double correlation(const double x[], const double y[]) {
    double sum = 0.0;
    for (int k = 0; k < N; k++) {
        sum += x[k] * y[k];
    }
    return sum / N;
}

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
    for (int i = 0; i < 2; i++) {
        const uint64_t word = ((uint64_t)SEED << 32) + (uint64_t)i;
        const uint64_t state = rp_sensor_hash(word - UINT64_C(0x9E3779B97F4A7C15), 0);
        for (uint64_t k = 0; k < 1000; k++) {
            const double u1 = (double)((rp_sensor_hash(state, 2 * k) >> 11) + 1) * 0x1p-53;
            const double u2 = (double)(rp_sensor_hash(state, 2 * k + 1) >> 11) * 0x1p-53;
            const double expected = sqrt(-2.0 * log(u1)) * cos(2.0 * acos(-1.0) * u2);
            TEST_ASSERT_DOUBLE_WITHIN(1e-14, expected, noise[i][k]);
        }
    }
}

/* Chi squared of cells that are equally probable. */
static void test_normality(void) {
    for (int i = 0; i < 2; i++) {
        int cells[CELLS] = {0};
        for (int k = 0; k < N; k++) {
            const double probability = 0.5 * erfc(-noise[i][k] / sqrt(2.0));
            cells[(int)fmin(CELLS * probability, CELLS - 1.0)]++;
        }
        const double expected = (double)N / CELLS;
        double chi2 = 0.0;
        for (int c = 0; c < CELLS; c++) {
            chi2 += (cells[c] - expected) * (cells[c] - expected) / expected;
        }
        TEST_ASSERT_TRUE(chi2 < chi2_bound);
    }
}

/* Also of seeds that differ in one bit, the sign among them. */
static void test_seeds_are_independent(void) {
    static double other[N];
    const int seeds[] = {SEED + 1, SEED ^ (1 << 16), SEED | INT32_MIN, -SEED};
    for (size_t s = 0; s < sizeof seeds / sizeof seeds[0]; s++) {
        for (uint64_t k = 0; k < N; k++) {
            other[k] = rp_sensor_noise(seeds[s], 0, k);
        }
        TEST_ASSERT_DOUBLE_WITHIN(z_bound / sqrt(N), 0.0, correlation(noise[0], other));
        TEST_ASSERT_DOUBLE_WITHIN(z_bound / sqrt(N), 0.0, correlation(noise[1], other));
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
