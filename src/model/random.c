#include "random.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

static const double two_pi = 6.283185307179586;
static const double largest = 0x1p53; // up to which all whole numbers are doubles

/* Finalizer of SplitMix64: variant 13 of Stafford. */
static uint64_t finalize(uint64_t z) {
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    return z ^ (z >> 31);
}

/* Returns 53 bits of output n of the generator SplitMix64 that starts with `state`: Steele, Lea and
 * Flood, Fast splittable pseudorandom number generators, OOPSLA 2014, doi 10.1145/2660193.2660195.
 * The generator's state is a counter, so each output is a hash of its number. */
static uint64_t output(uint64_t state, uint64_t n) {
    return finalize(state + (n + 1) * UINT64_C(0x9E3779B97F4A7C15)) >> 11;
}

/* Returns the start of a generator: each seed and stream has its own, far from those of others. */
static uint64_t start_of(double seed, double stream) {
    return finalize((uint64_t)(int64_t)seed << 32 | (uint32_t)(int64_t)stream);
}

static bool are_whole(double seed, double k, double stream) {
    return fabs(seed) <= largest && fabs(k) <= largest && fabs(stream) <= largest;
}

double random_uniform(double seed, double k, double stream) {
    if (!are_whole(seed, k, stream)) {
        return (double)NAN;
    }
    // not the generator of normal numbers, which would follow from these
    const uint64_t state = finalize(start_of(seed, stream));
    return (double)output(state, (uint64_t)(int64_t)k) * 0x1p-53;
}

double random_normal(double seed, double k, double stream) {
    if (!are_whole(seed, k, stream)) {
        return (double)NAN;
    }
    const uint64_t state = start_of(seed, stream);
    const uint64_t n = 2 * (uint64_t)(int64_t)k;
    const double radius = sqrt(-2.0 * log((double)(output(state, n) + 1) * 0x1p-53)); // of (0, 1]
    return radius * cos(two_pi * ((double)output(state, n + 1) * 0x1p-53));           // of [0, 1)
}
