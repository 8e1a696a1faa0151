/* Random numbers that follow from their number: the same bits on all platforms, in any order.
 *
 * seed, k and stream are whole numbers within +-2^53; of seed and stream the last 32 bits count.
 * Numbers of other seeds, streams and k are independent of each other. NAN for other k. */
#pragma once

/* Returns a number that is uniform in [0, 1), a multiple of 2^-53. */
double random_uniform(double seed, double k, double stream);

/* Returns a standard normal number, at most 8.6 in magnitude. By Box and Muller (1958),
 * doi 10.1214/aoms/1177706645. */
double random_normal(double seed, double k, double stream);
