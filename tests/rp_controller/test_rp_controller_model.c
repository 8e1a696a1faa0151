/* The Jacobian of the controller, also where an effort is at its limit, and what is refused.
 * Derivatives are compared with sympy in test_controller.py. */
#include "last_text.h"
#include "model_test.h"
#include "rp_controller_law.h"
#include "rp_controller_model.h"
#include "rp_test_support.h"

#include <float.h>
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

enum { BELOW, AT, BEYOND, SIDES }; /* an effort and its limit */

/* A law with integral parts at both joints, or only at joint 2; each joint's effort is below, at or
 * beyond its limit. */
static void next_law(int mode, bool has_both, const int side[2], bool attached) {
    next_point(mode);
    at.v.payload_attached = attached;
    struct rp_controller_parameters *p = &at.v.parameters;
    p->Ki[0] = has_both ? 1.5 : 0.0;
    double unlimited[2];
    law_unlimited(p, at.v.payload_attached, &at.v.inputs, at.v.integral, unlimited);
    for (int i = 0; i < 2; i++) {
        static const double factors[SIDES] = {[BELOW] = 2.0, [AT] = 1.0, [BEYOND] = 0.5};
        p->limit[i] = factors[side[i]] * fabs(unlimited[i]);
    }
}

/* Column j at J[j]; the states and inputs in the values are not read. */
static void jacobian(double J[2][2]) {
    struct rp_controller_values parameters;
    memset(&parameters, 0xff, sizeof parameters); // NaN
    parameters.parameters = at.v.parameters;
    parameters.payload_attached = at.v.payload_attached;
    parameters.form = RP_CONTROLLER_CONTINUOUS;
    memset(J, 0xff, sizeof(double[2][2]));
    ASSERT_OK(
        rp_controller_model.jacobian(&parameters, 3.0, at.v.integral, at.v.inputs.q_ref, J[0]));
}

/* w' = Ki e - (u - limit) / (M Tt) at the limit and beyond, Ki e below it, 0 without Ki; u changes
 * with w by M, with computed torque by D. */
static void test_jacobian_is_that_of_the_integral_rates(void) {
    for (int n = 0; n < 3 * SIDES * SIDES * 2 * 8; n++) {
        const int side[2] = {n / 3 % SIDES, n / 9 % SIDES};
        const int mode = RP_CONTROLLER_PD + n % 3;
        double J[2][2];
        next_law(mode, n / 27 % 2 == 0, side, false);
        jacobian(J);

        const struct rp_controller_parameters *p = &at.v.parameters;
        double D[2][2] = {{p->inertia[0], 0.0}, {0.0, p->inertia[1]}};
        if (mode == RP_CONTROLLER_COMPUTED_TORQUE) {
            const struct arm arm = arm_in_state(&p->arm, at.v.inputs.q, at.v.inputs.dq);
            arm_mass_matrix(&arm, D);
        }
        for (int i = 0; i < 2; i++) {
            const bool follows = p->Ki[i] > 0.0 && side[i] != BELOW;
            for (int j = 0; j < 2; j++) {
                const double expected =
                    follows ? -D[i][j] / (p->inertia[i] * p->tracking_time) : 0.0;
                ASSERT_CLOSE(expected, J[j][i], 16 * DBL_EPSILON * fabs(expected));
            }
        }
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
