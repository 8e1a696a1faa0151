/* Random numbers against SplitMix64 as its author writes it. test_kinds.py calls them from a file
 * with equations; test_sensor.py tests the noise of RPSensor as random. */
#include "random.h"

#include <math.h>
#include <stdint.h>
#include <unity.h>

static const double pi = 3.141592653589793;

static uint64_t next(uint64_t *state) {
    uint64_t z = (*state += UINT64_C(0x9E3779B97F4A7C15));
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    return z ^ (z >> 31);
}

/* The numbers that the generator gives from the state 1234567 on, in its author's C program. */
static void test_the_generator_is_splitmix64(void) {
    static const uint64_t expected[] = {
        UINT64_C(6457827717110365317), UINT64_C(3203168211198807973), UINT64_C(9817491932198370423),
        UINT64_C(4593380528125082431), UINT64_C(16408922859458223821)};
    uint64_t state = 1234567;
    for (int n = 0; n < 5; n++) {
        TEST_ASSERT_EQUAL_UINT64(expected[n], next(&state));
    }
}

/* A word without the step to the next state. */
static uint64_t finalized(uint64_t word) {
    word -= UINT64_C(0x9E3779B97F4A7C15);
    return next(&word);
}

static double between_0_and_1(uint64_t *state) {
    return (double)(next(state) >> 11) * 0x1p-53;
}

static const int32_t seeds[] = {0, 20, -20, INT32_MAX, INT32_MIN};

static uint64_t word_of(int32_t seed, int32_t stream) {
    return ((uint64_t)(uint32_t)seed << 32) + (uint32_t)stream;
}

static void test_a_normal_number_is_made_of_two_words(void) {
    for (int n = 0; n < 15; n++) {
        const int32_t seed = seeds[n / 3], stream = n % 3 - 1;
        uint64_t state = finalized(word_of(seed, stream));
        for (int k = 0; k < 1000; k++) {
            const double u1 = between_0_and_1(&state) + 0x1p-53;
            const double expected = sqrt(-2.0 * log(u1)) * cos(2.0 * pi * between_0_and_1(&state));
            TEST_ASSERT_DOUBLE_WITHIN(1e-14, expected, random_normal(seed, k, stream));
        }
    }
}

static void test_a_uniform_number_is_a_word_of_another_generator(void) {
    for (int n = 0; n < 15; n++) {
        const int32_t seed = seeds[n / 3], stream = n % 3 - 1;
        uint64_t state = finalized(finalized(word_of(seed, stream)));
        for (int k = 0; k < 1000; k++) {
            const double expected = between_0_and_1(&state);
            TEST_ASSERT_EQUAL_DOUBLE(expected, random_uniform(seed, k, stream));
        }
    }
}

/* Every whole number of a double has numbers, which its 53 bits bound. */
static void test_numbers_are_bounded(void) {
    const double bound = sqrt(2.0 * 53.0 * log(2.0));
    for (int n = 0; n <= 53; n++) {
        for (int sign = -1; sign <= 1; sign += 2) {
            const double k = sign * ldexp(1.0, n);
            TEST_ASSERT_TRUE(fabs(random_normal(INT32_MIN, k, 1.0)) <= bound);
            const double u = random_uniform(INT32_MIN, k, 1.0);
            TEST_ASSERT_TRUE(u >= 0.0 && u < 1.0);
        }
    }
}

static void test_other_numbers_have_none(void) {
    static const double others[] = {0x1.0000000000001p53, -1e300, INFINITY, NAN};
    for (int n = 0; n < 4; n++) {
        TEST_ASSERT_TRUE(isnan(random_normal(others[n], 0.0, 0.0)));
        TEST_ASSERT_TRUE(isnan(random_normal(0.0, others[n], 0.0)));
        TEST_ASSERT_TRUE(isnan(random_uniform(0.0, others[n], 0.0)));
        TEST_ASSERT_TRUE(isnan(random_uniform(0.0, 0.0, others[n])));
    }
}

static void test_mean_and_variance(void) {
    enum { COUNT = 1 << 20 };
    double sum = 0.0, squares = 0.0, uniform = 0.0;
    for (int k = 0; k < COUNT; k++) {
        const double z = random_normal(7.0, k, 3.0);
        sum += z;
        squares += z * z;
        uniform += random_uniform(7.0, k, 3.0);
    }
    const double of_mean = 1.0 / sqrt(COUNT); // its standard deviation
    TEST_ASSERT_DOUBLE_WITHIN(4.0 * of_mean, 0.0, sum / COUNT);
    TEST_ASSERT_DOUBLE_WITHIN(4.0 * sqrt(2.0) * of_mean, 1.0, squares / COUNT);
    TEST_ASSERT_DOUBLE_WITHIN(4.0 * sqrt(1.0 / 12.0) * of_mean, 0.5, uniform / COUNT);
}
