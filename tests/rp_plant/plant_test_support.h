/* What the tests of the plant share: random plants, and the model's functions with their status
 * checked. Nothing here calls the equations but through struct model. */
#ifndef PLANT_TEST_SUPPORT_H
#define PLANT_TEST_SUPPORT_H

#include "rp_plant_model.h"
#include "rp_test_support.h"

enum { PLANT_STATES = 4, PLANT_INPUTS = 5 };

/* The arm of RPManipulator.fmu with every feature off, at rest, no mode decided. */
void plant_test_start(struct rp_plant_values *v);

/* A random arm in a random state with every feature off; the calculated fields are NaN. */
void plant_test_random_arm(struct rp_test_random *random, struct rp_plant_values *v);

/* The same with armature, damping, friction, payload and wrench, each off in some draws, and random
 * modes; no stops. */
void plant_test_random_plant(struct rp_test_random *random, struct rp_plant_values *v);

void plant_test_outputs(struct rp_plant_values *v);

/* update with constant inputs and absolute tolerances of 1e-10; indicator -1: none has triggered.
 */
void plant_test_update(struct rp_plant_values *v, int indicator);

/* The same with rates of the inputs (NULL: 0) and any set of triggered indicators (NULL: none). */
void plant_test_update_with(struct rp_plant_values *v, const bool *triggered, const double *du);

/* Bit for bit, but +0 equals -0; NaN fails. */
#define ASSERT_SAME(expected, actual) plant_test_same(expected, actual, __LINE__)
void plant_test_same(double expected, double actual, int line);

#endif
