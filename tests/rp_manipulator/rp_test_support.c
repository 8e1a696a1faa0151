#include "rp_test_support.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>

uint64_t rp_test_random_bits(struct rp_test_random *random) {
    uint64_t z = random->state += UINT64_C(0x9E3779B97F4A7C15);
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    return z ^ (z >> 31);
}

double rp_test_uniform(struct rp_test_random *random, double low, double high) {
    double unit = ldexp((double)(rp_test_random_bits(random) >> 11), -53);
    return ldexp(rint(ldexp(low + (high - low) * unit, 20)), -20);
}

/* 10^low to 10^high, zero in one draw of eight. */
static double decades_or_zero(struct rp_test_random *random, double low, double high) {
    double value = pow(10.0, rp_test_uniform(random, low, high));
    return rp_test_random_bits(random) % 8 == 0 ? 0.0 : value;
}

static double uniform_or_zero(struct rp_test_random *random, double low, double high) {
    double value = rp_test_uniform(random, low, high);
    return rp_test_random_bits(random) % 8 == 0 ? 0.0 : value;
}

void rp_test_random_parameters(struct rp_test_random *random, struct arm_parameters *p) {
    p->m1 = decades_or_zero(random, -2.0, 1.5);
    p->m2 = pow(10.0, rp_test_uniform(random, -2.0, 1.5));
    p->I1z = decades_or_zero(random, -3.0, 1.0);
    p->I2z = decades_or_zero(random, -3.0, 1.0);
    p->l1 = uniform_or_zero(random, 0.0, 2.0);
    p->lc1 = uniform_or_zero(random, 0.0, 2.0);
    p->a = uniform_or_zero(random, -1.5, 1.5);
    p->g = uniform_or_zero(random, -20.0, 20.0);
    if (rp_test_inertia(p, -p->l1) < 1e-3) {
        p->I1z = 1e-3;
    }
}

void rp_test_random_state(struct rp_test_random *random, struct rp_test_state *state) {
    state->q[0] = rp_test_uniform(random, -3.2, 3.2);
    state->q[1] = rp_test_uniform(random, -3.0, 2.0);
    for (int i = 0; i < 2; ++i) {
        state->dq[i] = rp_test_uniform(random, -5.0, 5.0);
        state->ddq[i] = rp_test_uniform(random, -20.0, 20.0);
        state->tau[i] = rp_test_uniform(random, -50.0, 50.0);
    }
}

void rp_test_default_parameters(struct arm_parameters *p) {
    *p = (struct arm_parameters){
        .m1 = 2.0, .m2 = 1.0, .I1z = 0.1, .I2z = 0.05, .l1 = 0.5, .lc1 = 0.25, .a = 0.1, .g = 9.81};
}

double rp_test_inertia(const struct arm_parameters *p, double q2) {
    double L = p->l1 + q2;
    return p->m1 * p->lc1 * p->lc1 + p->I1z + p->I2z + p->m2 * L * L;
}

void rp_test_close(double expected, double actual, double bound, int line) {
    if (fabs(actual - expected) <= bound) {
        return;
    }
    char message[160];
    snprintf(message, sizeof message, "expected %.17g was %.17g, off by %.3g, allowed %.3g",
             expected, actual, actual - expected, bound);
    UNITY_TEST_FAIL((UNITY_UINT)line, message);
}
