/* The law of computed torque by jets (jet.h), along inputs that are cubic in time: against the
 * derivatives that the model has, and in all orders against Cauchy's integrals of the law. */
#include "jet.h"
#include "rp_controller_model.h"
#include "rp_test_support.h"

#include <complex.h>
#include <float.h>
#include <math.h>
#include <string.h>
#include <unity.h>

enum { SAMPLES = 50, NODES = 128, DEGREE = 3 };

typedef double jet[SERIES_LENGTH];
typedef long double complex number;

/* Coefficients of the time, by joint; w: the integral parts. */
struct curve {
    jet q_ref[2], dq_ref[2], ddq_ref[2], q[2], dq[2], w[2];
};

static struct rp_test_random random_source;
static struct rp_controller_parameters p;
static struct curve curve;

void setUp(void) {
    random_source.state = 31;
}
static void next_polynomial(jet x) {
    memset(x, 0, sizeof(jet));
    for (int k = 0; k <= DEGREE; k++) {
        x[k] = rp_test_uniform(&random_source, -2.0, 2.0);
    }
}

static void next_sample(void) {
    memset(&p, 0, sizeof p);
    rp_test_random_parameters(&random_source, &p.arm);
    p.mode = RP_CONTROLLER_COMPUTED_TORQUE;
    p.tracking_time = 1.0;
    for (int i = 0; i < 2; i++) {
        p.Kp[i] = rp_test_uniform(&random_source, 0.0, 100.0);
        p.Kd[i] = rp_test_uniform(&random_source, 0.0, 20.0);
        p.inertia[i] = 1.0;
        p.limit[i] = INFINITY;
        next_polynomial(curve.q_ref[i]);
        next_polynomial(curve.dq_ref[i]);
        next_polynomial(curve.ddq_ref[i]);
        next_polynomial(curve.q[i]);
        next_polynomial(curve.dq[i]);
        next_polynomial(curve.w[i]);
    }
}

/* ---- By jets -------------------------------------------------------------------------------- */

/* D (ddq_ref + v) + C q' + g with v = Kp e + Kd de + w. */
static void efforts_by_jets(jet efforts[2]) {
    const struct rp_parameters *arm = &p.arm;
    const double m2 = arm->m2;
    jet a[2], L, J, s, c, m2_L_dq1;
    for (int k = 0; k < SERIES_LENGTH; k++) {
        // commanded accelerations
        for (int i = 0; i < 2; i++) {
            const double error = curve.q_ref[i][k] - curve.q[i][k];
            const double derror = curve.dq_ref[i][k] - curve.dq[i][k];
            a[i][k] = curve.ddq_ref[i][k] + p.Kp[i] * error + p.Kd[i] * derror + curve.w[i][k];
        }

        // what the terms of the equations share
        L[k] = curve.q[1][k] + (k == 0 ? arm->l1 : 0.0);
        J[k] = m2 * jet_square(L, k) + (k == 0 ? rp_fixed_inertia(arm) : 0.0);
        jet_sine_cosine(curve.q[0], s, c, k);
        m2_L_dq1[k] = m2 * jet_product(L, curve.dq[0], k);

        // D a + C q' + g
        const double lever2 = jet_product(L, c, k) - arm->a * s[k];
        efforts[0][k] = jet_product(J, a[0], k) + m2 * arm->a * (arm->a * a[0][k] - a[1][k]) +
                        2.0 * jet_product(m2_L_dq1, curve.dq[1], k) +
                        arm->g * (arm->m1 * arm->lc1 * c[k] + m2 * lever2);
        efforts[1][k] = m2 * (a[1][k] - arm->a * a[0][k]) - jet_product(m2_L_dq1, curve.dq[0], k) +
                        m2 * arm->g * s[k];
    }
}

/* ---- Cauchy's integrals --------------------------------------------------------------------- */

static number at_time(const jet x, number t) {
    number sum = 0.0L;
    for (int k = DEGREE; k >= 0; k--) {
        sum = sum * t + x[k];
    }
    return sum;
}

/* (14) and (15) as they stand, at a complex time; scale: the sums of their absolute terms. */
static void efforts_at(number t, number efforts[2], double scale[2]) {
    const struct rp_parameters *arm = &p.arm;
    number a[2];
    double size[2];
    for (int i = 0; i < 2; i++) {
        const number q = at_time(curve.q[i], t);
        const number dq = at_time(curve.dq[i], t);
        const number terms[4] = {
            at_time(curve.ddq_ref[i], t),
            p.Kp[i] * (at_time(curve.q_ref[i], t) - q),
            p.Kd[i] * (at_time(curve.dq_ref[i], t) - dq),
            at_time(curve.w[i], t),
        };
        a[i] = terms[0] + terms[1] + terms[2] + terms[3];
        size[i] = 0.0;
        for (int k = 0; k < 4; k++) {
            size[i] += (double)cabsl(terms[k]);
        }
    }
    const number L = arm->l1 + at_time(curve.q[1], t);
    const number q1 = at_time(curve.q[0], t);
    const number dq1 = at_time(curve.dq[0], t);
    const number dq2 = at_time(curve.dq[1], t);
    const number inertia = rp_fixed_inertia(arm) + arm->m2 * (L * L + arm->a * arm->a);
    const number c = ccosl(q1);
    const number s = csinl(q1);
    const number first[5] = {
        inertia * a[0],
        -arm->m2 * arm->a * a[1],
        2.0L * arm->m2 * L * dq1 * dq2,
        arm->g * (arm->m1 * arm->lc1 + arm->m2 * L) * c,
        -arm->g * arm->m2 * arm->a * s,
    };
    const number second[4] = {
        -arm->m2 * arm->a * a[0],
        arm->m2 * a[1],
        -arm->m2 * L * dq1 * dq1,
        arm->m2 * arm->g * s,
    };
    efforts[0] = first[0] + first[1] + first[2] + first[3] + first[4];
    efforts[1] = second[0] + second[1] + second[2] + second[3];
    const double cross = arm->m2 * fabs(arm->a);
    scale[0] = (double)cabsl(inertia) * size[0] + cross * size[1] + (double)cabsl(first[2]) +
               (double)cabsl(first[3]) + (double)cabsl(first[4]);
    scale[1] =
        cross * size[0] + arm->m2 * size[1] + (double)cabsl(second[2]) + (double)cabsl(second[3]);
}

/* Coefficients by the mean of f(t) t^-k over the unit circle, on which no function here has a pole,
 * and the largest sum of absolute terms there: a bound of the terms of each coefficient. */
static void integrate(double scale[2], jet coefficients[2]) {
    number sums[2][SERIES_LENGTH] = {{0.0L}};
    scale[0] = scale[1] = 0.0;
    for (int n = 0; n < NODES; n++) {
        const long double angle = 2.0L * acosl(-1.0L) * n / NODES;
        const number t = cosl(angle) + sinl(angle) * I;
        number efforts[2];
        double size[2];
        efforts_at(t, efforts, size);
        number power = 1.0L;
        for (int k = 0; k < SERIES_LENGTH; k++) {
            sums[0][k] += efforts[0] * power;
            sums[1][k] += efforts[1] * power;
            power *= conjl(t);
        }
        scale[0] = fmax(scale[0], size[0]);
        scale[1] = fmax(scale[1], size[1]);
    }
    for (int k = 0; k < SERIES_LENGTH; k++) {
        coefficients[0][k] = (double)(creall(sums[0][k]) / NODES);
        coefficients[1][k] = (double)(creall(sums[1][k]) / NODES);
    }
}

static void test_coefficients_are_the_integrals_of_the_law(void) {
    for (int n = 0; n < SAMPLES; n++) {
        next_sample();
        jet efforts[2];
        jet expected[2];
        double scale[2];
        efforts_by_jets(efforts);
        integrate(scale, expected);
        for (int k = 0; k < SERIES_LENGTH; k++) {
            for (int i = 0; i < 2; i++) {
                ASSERT_CLOSE(expected[i][k], efforts[i][k], 8.0 * DBL_EPSILON * scale[i]);
            }
        }
    }
}

/* ---- Derivatives of the model --------------------------------------------------------------- */

/* Values, first or second derivatives of the inputs at the time 0. */
static void read_curve(int order, struct rp_controller_values *values) {
    const double factorial = order == 2 ? 2.0 : 1.0;
    for (int i = 0; i < 2; i++) {
        values->inputs.q_ref[i] = factorial * curve.q_ref[i][order];
        values->inputs.dq_ref[i] = factorial * curve.dq_ref[i][order];
        values->inputs.ddq_ref[i] = factorial * curve.ddq_ref[i][order];
        values->inputs.q[i] = factorial * curve.q[i][order];
        values->inputs.dq[i] = factorial * curve.dq[i][order];
        values->integral[i] = factorial * curve.w[i][order];
    }
}

static void test_derivatives_are_those_of_the_model(void) {
    for (int n = 0; n < SAMPLES; n++) {
        next_sample();
        jet efforts[2];
        jet coefficients[2];
        double scale[2];
        efforts_by_jets(efforts);
        integrate(scale, coefficients);

        struct rp_controller_values values = {.parameters = p};
        struct rp_controller_values first = {0};
        struct rp_controller_values second = {0};
        double unlimited[2];
        read_curve(0, &values);
        read_curve(1, &first);
        read_curve(2, &second);
        rp_controller_unlimited(&p, false, &values.inputs, values.integral, unlimited);
        rp_controller_propagate(&values, 0.0, 0.0, &first, &second);
        for (int i = 0; i < 2; i++) {
            const double bound = 8.0 * DBL_EPSILON * scale[i];
            ASSERT_CLOSE(unlimited[i], efforts[i][0], bound);
            ASSERT_CLOSE(first.unlimited[i], efforts[i][1], bound);
            ASSERT_CLOSE(second.unlimited[i] / 2.0, efforts[i][2], bound);
        }
    }
}
