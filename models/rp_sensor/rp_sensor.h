/* Equations of an incremental encoder: noise, and the count that a position gives. The page
 * README.md derives them. */
#pragma once

#include <stdint.h>

/* Largest magnitude of a count, at which the counter stops. */
enum { RP_SENSOR_COUNT_MAX = INT32_MAX };

/* Output n, from 0 on, of the generator SplitMix64 that starts with `state`: Steele, Lea and Flood,
 * Fast splittable pseudorandom number generators, OOPSLA 2014, doi 10.1145/2660193.2660195; its
 * finalizer is variant 13 of Stafford. The generator's state is a counter, so each output is a hash
 * of its number.
 */
uint64_t rp_sensor_hash(uint64_t state, uint64_t n);

/* Standard normal number of a tick: a function of its arguments and nothing else. channel: the
 * joint, 0 or 1. By Box and Muller (1958), doi 10.1214/aoms/1177706645; at most 8.6 in magnitude.
 */
double rp_sensor_noise(int seed, int channel, uint64_t tick);

/* Count of a position: the nearest multiple of the resolution, and of two the upper one; from
 * -RP_SENSOR_COUNT_MAX to RP_SENSOR_COUNT_MAX. Both arguments in the same unit; position is no NaN,
 * resolution above 0. */
int rp_sensor_count(double position, double resolution);
