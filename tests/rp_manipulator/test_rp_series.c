/* The series of a motion against the equations of motion.
 *
 * Bounds: textbook() with all terms added up by their absolute values gives each coefficient and
 * each error of one a majorant, which epsilons are counted of. */
#include "last_text.h"
#include "rp_series.h"

#include "jet.h"
#include "rp_equations.h"
#include "rp_model.h"
#include "rp_test_support.h"
#include "unity.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define EPS     DBL_EPSILON
#define SAMPLES 300

enum { Q1, Q2, W, V, MAX_ROWS = 16, ORDER = 20 };

typedef double jet[SERIES_LENGTH];

static struct rp_test_random random_source;
static struct rp_values at;
static double time_scale;
static double inputs[2][SERIES_INPUT_LENGTH];
static jet row[MAX_ROWS];

void setUp(void) {
    random_source.state = 23;
    memset(&at, 0, sizeof at);
    memset(inputs, 0, sizeof inputs);
    time_scale = 1.0;
    rp_test_default_parameters(&at.parameters);
}
static void next_sample(void) {
    struct rp_test_state state;
    rp_test_random_parameters(&random_source, &at.parameters);
    rp_test_random_state(&random_source, &state);
    memcpy(at.q, state.q, sizeof state.q);
    memcpy(at.dq, state.dq, sizeof state.dq);
    memcpy(at.tau, state.tau, sizeof state.tau);
    time_scale = pow(2.0, rp_test_uniform(&random_source, -10.0, 0.0));
    for (int i = 0; i < 2; i++) {
        inputs[i][0] = at.tau[i];
        for (int k = 1; k < SERIES_INPUT_LENGTH; k++) {
            inputs[i][k] = rp_test_uniform(&random_source, -20.0, 20.0) * pow(time_scale, k);
        }
    }
}

static void extend(int first, int last) {
    const struct series_origin origin = {
        .values = &at,
        .time_scale = time_scale,
        .inputs = (const double(*)[SERIES_INPUT_LENGTH])inputs,
    };
    TEST_ASSERT_LESS_OR_EQUAL_size_t(MAX_ROWS, rp_series.row_count);
    ASSERT_OK(rp_series.extend(&origin, first, last, row));
}

/* The series of the sample's motion, all orders. */
static void expand(void) {
    memset(row, 0xff, sizeof row); // NaN: what is read has been written
    row[Q1][0] = at.q[0];
    row[Q2][0] = at.q[1];
    row[W][0] = at.dq[0];
    row[V][0] = at.dq[1];
    extend(0, SERIES_LENGTH - 1);
}

/* ---- The textbook form ---------------------------------------------------------------------- */

/* A motion by jets, in velocities. */
struct motion {
    jet q1, q2, dq1, dq2, ddq1, ddq2;
    jet L, J, s, c; // of the link: l1 + q2, inertia, sine and cosine
    jet L_dq1, L_dq1_dq1, mixed, coriolis, L_c, L_L, efforts;
};

static const double textbook = -1.0;
static const double majorant = 1.0;

static double term(double minus, double x) {
    return minus == majorant ? fabs(x) : x;
}

static void begin(double minus, struct motion *m) {
    m->q1[0] = at.q[0];
    m->q2[0] = at.q[1];
    m->dq1[0] = term(minus, at.dq[0]);
    m->dq2[0] = term(minus, at.dq[1]);
    m->L[0] = term(minus, at.parameters.l1 + at.q[1]);
    m->J[0] = rp_test_inertia(&at.parameters, at.q[1]);
    m->s[0] = minus == majorant ? 1.0 : sin(at.q[0]);
    m->c[0] = minus == majorant ? 1.0 : cos(at.q[0]);
}

/* Writes order k > 0 of s = sin x and c = cos x, from s' = c x' and c' = -s x'. */
static void sine_cosine(const jet x, jet s, jet c, int k) {
    s[k] = 0.0;
    c[k] = 0.0;
    for (int i = 1; i <= k; i++) {
        s[k] += i * x[i] * c[k - i] / k;
        c[k] -= i * x[i] * s[k - i] / k;
    }
}

/* Returns order k of z = x / y, from x = z y. */
static double quotient(const jet x, const jet y, const jet z, int k) {
    double rest = x[k];
    for (int i = 1; i <= k; i++) {
        rest -= y[i] * z[k - i];
    }
    return rest / y[0];
}

/* What order k of q and q' follows from, and its functions; sinh and cosh are majorants. */
static void next_order(double minus, int k, struct motion *m) {
    m->q1[k] = jet_integral(m->dq1, time_scale, k);
    m->q2[k] = jet_integral(m->dq2, time_scale, k);
    m->dq1[k] = jet_integral(m->ddq1, time_scale, k);
    m->dq2[k] = jet_integral(m->ddq2, time_scale, k);
    m->L[k] = m->q2[k];
    m->L_L[k] = jet_product(m->L, m->L, k);
    m->J[k] = -minus * at.parameters.m2 * m->L_L[k];
    sine_cosine(m->q1, m->s, m->c, k);
    m->c[k] *= -minus;
}

/* (13) solved for q'':
 *
 *   q1'' = (tau1 + a f2 + m2 L q1' (a q1' - 2 q2') - g c1 (m1 lc1 + m2 L)) / J
 *   q2'' = f2 / m2 + L q1'^2 - g s1 + a q1''
 *
 * minus: the sign of what is subtracted, `majorant` where absolute values are added up. */
static void expand_by_jets(double minus, int last, struct motion *m) {
    const struct rp_parameters *p = &at.parameters;
    const double a = term(minus, p->a);
    const double g = term(minus, p->g);
    for (int k = 0; k <= last; k++) {
        if (k == 0) {
            begin(minus, m);
        } else {
            next_order(minus, k, m);
        }
        const double tau1 = k < SERIES_INPUT_LENGTH ? term(minus, inputs[0][k]) : 0.0;
        const double f2 = k < SERIES_INPUT_LENGTH ? term(minus, inputs[1][k]) : 0.0;
        m->mixed[k] = a * m->dq1[k] + minus * 2.0 * m->dq2[k];
        m->L_dq1[k] = jet_product(m->L, m->dq1, k);
        m->L_dq1_dq1[k] = jet_product(m->L_dq1, m->dq1, k);
        m->coriolis[k] = jet_product(m->L_dq1, m->mixed, k);
        m->L_c[k] = jet_product(m->L, m->c, k);
        m->efforts[k] = tau1 + a * f2 + p->m2 * m->coriolis[k] +
                        minus * g * (p->m1 * p->lc1 * m->c[k] + p->m2 * m->L_c[k]);
        m->ddq1[k] = quotient(m->efforts, m->J, m->ddq1, k);
        m->ddq2[k] = f2 / p->m2 + m->L_dq1_dq1[k] + minus * g * m->s[k] + a * m->ddq1[k];
    }
}

static void test_coefficients_are_those_of_the_textbook_form(void) {
    static struct motion expected, bound;
    for (int n = 0; n < SAMPLES; n++) {
        next_sample();
        expand();
        expand_by_jets(textbook, ORDER, &expected);
        expand_by_jets(majorant, ORDER, &bound);
        for (int k = 1; k <= ORDER; k++) {
            const double count = 8.0 * k * EPS;
            ASSERT_CLOSE(expected.q1[k], row[Q1][k], count * bound.q1[k]);
            ASSERT_CLOSE(expected.q2[k], row[Q2][k], count * bound.q2[k]);
            ASSERT_CLOSE(expected.dq1[k], row[W][k], count * bound.dq1[k]);
            ASSERT_CLOSE(expected.dq2[k], row[V][k], count * bound.dq2[k]);
        }
    }
}
