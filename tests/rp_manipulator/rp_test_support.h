/* Seeded random samples and rounding bounds, for tests of models. Nothing here calls the code under
 * test.
 *
 * Bounds are a count of DBL_EPSILON times a scale, the sum of the absolute values of the terms
 * that are added up: each operation of a sum or product errs by at most half an epsilon of it. */
#ifndef RP_TEST_SUPPORT_H
#define RP_TEST_SUPPORT_H

#include "rp_manipulator.h"

#include <stdint.h>

#define RP_TEST_PI      3.14159265358979323846
#define RP_TEST_SAMPLES 1000

/* A point of the state space with accelerations and generalized forces of the same size. */
struct rp_test_state {
    double q[2];
    double dq[2];
    double ddq[2];
    double tau[2];
};

/* splitmix64: the same numbers everywhere, whatever the C library's rand() does. */
struct rp_test_random {
    uint64_t state;
};

uint64_t rp_test_random_bits(struct rp_test_random *random);

/* Uniform between low and high, on multiples of 2^-20: sums such as l1 + q2 and steps by a power of
 * two then carry no rounding error that a numeric derivative would magnify. */
double rp_test_uniform(struct rp_test_random *random, double low, double high);

/* Valid parameters over several decades; zero where zero is allowed in one draw of eight. */
void rp_test_random_parameters(struct rp_test_random *random, struct arm_parameters *p);

/* l1 + q2 takes both signs. */
void rp_test_random_state(struct rp_test_random *random, struct rp_test_state *state);

/* The parameters that RPManipulator.fmu starts with. */
void rp_test_default_parameters(struct arm_parameters *p);

/* m1 lc1^2 + I1z + I2z + m2 (l1 + q2)^2, called J. */
double rp_test_inertia(const struct arm_parameters *p, double q2);

/* Fails the running test unless |actual - expected| <= bound; NaN fails. */
#define ASSERT_CLOSE(expected, actual, bound) rp_test_close(expected, actual, bound, __LINE__)
void rp_test_close(double expected, double actual, double bound, int line);

#endif
