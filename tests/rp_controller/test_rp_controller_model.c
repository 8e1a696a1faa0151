/* The Jacobian of the controller where an effort is at its limit, and what is refused.
 * Derivatives are compared with sympy in test_controller.py. */
#include "last_text.h"
#include "model_test.h"
#include "rp_controller_law.h"
#include "rp_controller_model.h"
#include "rp_test_support.h"

#include <math.h>
#include <string.h>
#include <unity.h>

/* All that is real: from arm to payload_z, and from the inputs to the integral part. */
enum {
    PARAMETERS = offsetof(struct rp_controller_parameters, sample_time) / sizeof(double),
    INPUTS = offsetof(struct rp_controller_values, inputs) / sizeof(double),
    KNOWNS = offsetof(struct rp_controller_values, payload_attached) / sizeof(double),
};

static union {
    struct rp_controller_values v;
    double all[KNOWNS];
} at;
static struct rp_test_random random_source;

void setUp(void) {
    random_source.state = 7;
}
static void next_point(int mode) {
    memset(&at, 0, sizeof at);
    for (int i = 0; i < KNOWNS; i++) {
        if (i < PARAMETERS || i >= INPUTS) {
            at.all[i] = rp_test_uniform(&random_source, 0.5, 2.0);
        }
    }
    at.v.parameters.mode = mode;
    // efforts of both signs
    const double side = rp_test_uniform(&random_source, -1.0, 1.0) < 0.0 ? -64.0 : 64.0;
    at.v.integral[0] += side;
    at.v.integral[1] -= side;
}

/* ---- Jacobian ------------------------------------------------------------------------------- */

static void jacobian(double J[2][2]) {
    memset(J, 0xff, sizeof(double[2][2]));
    ASSERT_OK(rp_controller_model.jacobian(&at, 3.0, at.v.integral, at.v.inputs.q_ref, J[0]));
}

/* Efforts below their limits and beyond them: test_every_model.c. */
static void test_an_effort_at_its_limit_counts_as_beyond(void) {
    for (int n = 0; n < 24; n++) {
        double J[2][2], beyond[2][2];
        next_point(RP_CONTROLLER_PD + n % 3);
        at.v.form = RP_CONTROLLER_CONTINUOUS;
        double *limit = at.v.parameters.limit;
        law_unlimited(&at.v.parameters, false, &at.v.inputs, at.v.integral, limit);
        for (int i = 0; i < 2; i++) {
            limit[i] = fabs(limit[i]);
        }
        jacobian(J);
        limit[0] *= 0.5;
        limit[1] *= 0.5;
        jacobian(beyond);
        TEST_ASSERT_EQUAL_MEMORY(beyond, J, sizeof J);
        TEST_ASSERT_TRUE(J[0][0] < 0.0 && J[1][1] < 0.0);
    }
}

/* ---- What is refused ------------------------------------------------------------------------ */

static void assert_refused(const char *expected) {
    model_test_refused(&rp_controller_model, &at, expected);
}

static void test_times_that_do_not_fit_are_refused(void) {
    next_point(RP_CONTROLLER_PD);
    struct rp_controller_parameters *p = &at.v.parameters;
    p->delay = 0.0625;
    assert_refused("delay = 0.0625 s is refused: it must not be above sample_time = 0 s");
    p->sample_time = 0.03125;
    assert_refused("delay = 0.0625 s is refused: it must not be above sample_time = 0.03125 s");
    p->sample_time = 0.999e-6;
    assert_refused("sample_time = 9.99e-07 s is refused: it must be 0, for a continuous law, or at "
                   "least 1e-06 s");
    p->sample_time = p->delay = 1e-6;
    model_test_accepted(&rp_controller_model, &at);
}

static void test_an_arm_without_inertia_is_refused(void) {
    next_point(RP_CONTROLLER_PD);
    struct rp_parameters *arm = &at.v.parameters.arm;
    model_test_accepted(&rp_controller_model, &at);
    arm->m1 = 2.0;
    arm->lc1 = arm->I1z = arm->I2z = 0.0;
    assert_refused("the inertia m1 lc1^2 + I1z + I2z = 0 is refused: it must be above 0 "
                   "(m1 = 2, lc1 = 0, I1z = 0, I2z = 0)");
}
