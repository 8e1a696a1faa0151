#include "rp_sensor.h"

#include <math.h>

static const double two_pi = 6.283185307179586;

static uint64_t finalize(uint64_t z) {
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    return z ^ (z >> 31);
}

uint64_t rp_sensor_hash(uint64_t state, uint64_t n) {
    return finalize(state + (n + 1) * UINT64_C(0x9E3779B97F4A7C15));
}

double rp_sensor_noise(int seed, int channel, uint64_t tick) {
    // each seed and channel has its own start, far from those of the others
    const uint64_t state = finalize((uint64_t)(uint32_t)seed << 32 | (uint32_t)channel);
    const uint64_t first = rp_sensor_hash(state, 2 * tick) >> 11;
    const uint64_t second = rp_sensor_hash(state, 2 * tick + 1) >> 11;
    const double radius = sqrt(-2.0 * log((double)(first + 1) * 0x1p-53)); // of (0, 1]
    return radius * cos(two_pi * ((double)second * 0x1p-53));              // of [0, 1)
}

/* Half up, by the rest: a sum with 1/2 would round 0.49999999999999994 up. */
static double rounded(double x) {
    const double whole = floor(x);
    return x - whole >= 0.5 ? whole + 1.0 : whole;
}

int rp_sensor_count(double position, double resolution) {
    const int most = RP_SENSOR_COUNT_MAX;
    const double x = position / resolution;
    if (x >= most) {
        return most;
    }
    if (x <= -most) {
        return -most;
    }
    return (int)rounded(x);
}
