/* The series of a motion against the equations of motion, closed forms and the balance of energy.
 *
 * Bounds: textbook() with all terms added up by their absolute values gives each coefficient and
 * each error of one a majorant, which epsilons are counted of. */
#include "last_text.h"
#include "rp_series.h"

#include "jet.h"
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

/* What order k of q and q' follows from, and its functions; sinh and cosh are majorants. */
static void next_order(double minus, int k, struct motion *m) {
    m->q1[k] = jet_integral(m->dq1, time_scale, k);
    m->q2[k] = jet_integral(m->dq2, time_scale, k);
    m->dq1[k] = jet_integral(m->ddq1, time_scale, k);
    m->dq2[k] = jet_integral(m->ddq2, time_scale, k);
    m->L[k] = m->q2[k];
    m->L_L[k] = jet_square(m->L, k);
    m->J[k] = -minus * at.parameters.m2 * m->L_L[k];
    jet_sine_cosine(m->q1, m->s, m->c, k);
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
        m->ddq1[k] = jet_quotient(m->efforts, m->J, m->ddq1, k);
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

/* ---- Derivatives that the model has --------------------------------------------------------- */

static void assert_derivative(const double ddq[2], int order, double count) {
    static struct motion bound;
    expand_by_jets(majorant, order, &bound);
    // coefficient k = order of q' is time_scale^k / k! times this derivative of q''
    const double scale = pow(time_scale, order) / tgamma(order + 1.0);
    ASSERT_CLOSE(ddq[0] * scale, row[W][order], count * EPS * bound.dq1[order]);
    ASSERT_CLOSE(ddq[1] * scale, row[V][order], count * EPS * bound.dq2[order]);
}

static void test_derivatives_are_those_of_the_forward_dynamics(void) {
    for (int n = 0; n < SAMPLES; n++) {
        next_sample();
        expand();
        double ddq[2];
        rp_forward_dynamics(&at.parameters, at.q, at.dq, at.tau, ddq);
        assert_derivative(ddq, 1, 16.0);

        // along the motion
        struct rp_values first = {.q = {at.dq[0], at.dq[1]}, .dq = {ddq[0], ddq[1]}};
        struct rp_values second = {.q = {ddq[0], ddq[1]}};
        for (int i = 0; i < 2; i++) {
            first.tau[i] = inputs[i][1] / time_scale;
            second.tau[i] = 2.0 * inputs[i][2] / (time_scale * time_scale);
        }
        rp_propagate(&at, 0.0, 0.0, &first, NULL);
        assert_derivative(first.ddq, 2, 32.0);
        memcpy(second.dq, first.ddq, sizeof second.dq);
        rp_propagate(&at, 0.0, 0.0, &first, &second);
        assert_derivative(second.ddq, 3, 64.0);
    }
}

/* ---- Bits ----------------------------------------------------------------------------------- */

static void test_any_number_of_orders_at_once_gives_the_same_bits(void) {
    for (int n = 0; n < SAMPLES; n++) {
        next_sample();
        expand();
        static jet at_once[MAX_ROWS];
        memcpy(at_once, row, sizeof row);
        for (size_t i = 4; i < rp_series.row_count; i++) {
            row[i][0] = NAN;
        }
        for (int i = 0; i < MAX_ROWS; i++) {
            for (int k = 1; k < SERIES_LENGTH; k++) {
                row[i][k] = NAN;
            }
        }
        for (int first = 0; first < SERIES_LENGTH;) {
            const int more = n == 0 ? 0 : (int)(rp_test_random_bits(&random_source) % 5);
            const int last = first + more < SERIES_LENGTH ? first + more : SERIES_LENGTH - 1;
            extend(first, last);
            first = last + 1;
        }
        TEST_ASSERT_EQUAL_MEMORY(at_once, row, rp_series.row_count * sizeof row[0]);
    }
}

/* ---- Closed forms --------------------------------------------------------------------------- */

static void assert_rows(const jet q1, const jet q2, const double scale[], double count) {
    for (int k = 0; k < SERIES_LENGTH; k++) {
        ASSERT_CLOSE(q1[k], row[Q1][k], count * EPS * scale[k]);
        ASSERT_CLOSE(q2[k], row[Q2][k], count * EPS * scale[k]);
        if (k + 1 < SERIES_LENGTH) {
            ASSERT_CLOSE(q1[k + 1] * (k + 1) / time_scale, row[W][k], count * EPS * scale[k]);
            ASSERT_CLOSE(q2[k + 1] * (k + 1) / time_scale, row[V][k], count * EPS * scale[k]);
        }
    }
}

/* Link 1 upright and at rest: link 2 falls along it. */
static void test_free_fall_along_the_upright_link(void) {
    const double g = at.parameters.g;
    at.q[0] = 0.5 * RP_TEST_PI; // whose cosine is 6e-17
    at.q[1] = 0.25;
    at.dq[1] = 1.5;
    time_scale = 0.125; // s: until then J is far from 0
    expand();
    const jet q1 = {at.q[0]};
    const jet q2 = {0.25, 1.5 * time_scale, -g * time_scale * time_scale / 2.0};
    jet scale;
    for (int k = 0; k < SERIES_LENGTH; k++) {
        scale[k] = g;
    }
    assert_rows(q1, q2, scale, 16.0);
}

/* Without gravity, the slide pushed by a cubic force while the joint rests. */
static void test_slide_under_a_cubic_force(void) {
    at.parameters.a = at.parameters.g = 0.0;
    at.q[0] = 1.0;
    at.q[1] = 0.25;
    at.dq[1] = -2.0;
    time_scale = 0.5;
    for (int k = 0; k < SERIES_INPUT_LENGTH; k++) {
        inputs[1][k] = k + 1.0;
    }
    expand();
    const jet q1 = {1.0};
    jet q2 = {0.25, -2.0 * time_scale};
    jet scale = {1.0, 2.0};
    for (int k = 0; k < SERIES_INPUT_LENGTH; k++) {
        q2[k + 2] = time_scale * time_scale * inputs[1][k] / at.parameters.m2 / ((k + 1) * (k + 2));
        scale[k + 1] = 8.0;
    }
    scale[SERIES_INPUT_LENGTH + 1] = 8.0;
    assert_rows(q1, q2, scale, 4.0);
}

/* The force that keeps link 2 at its place lets the arm turn evenly. */
static void test_even_rotation(void) {
    at.parameters.a = at.parameters.g = 0.0;
    at.dq[0] = 3.0;
    inputs[1][0] = -at.parameters.m2 * at.parameters.l1 * 9.0;
    expand();
    const jet q1 = {0.0, 3.0};
    const jet q2 = {0.0};
    const jet scale = {0.0};
    assert_rows(q1, q2, scale, 0.0);
}

/* If link 1 has neither mass nor inertia, link 2 is a point that flies freely, on a parabola. Its
 * distance r from the joint has r^2 = L^2 + a^2, its direction is q1 + atan2(a, L). */
static void parabola(jet q1, jet q2) {
    const struct rp_parameters *p = &at.parameters;
    const double s1 = sin(at.q[0]);
    const double c1 = cos(at.q[0]);
    const double along = at.dq[1] - p->a * at.dq[0];
    const double across = at.q[1] * at.dq[0];
    const jet x = {at.q[1] * c1 - p->a * s1, time_scale * (along * c1 - across * s1)};
    const jet y = {at.q[1] * s1 + p->a * c1, time_scale * (along * s1 + across * c1),
                   -0.5 * p->g * time_scale * time_scale};
    const jet a = {p->a};
    jet L_L, r2, direction, slant;
    for (int k = 0; k < SERIES_LENGTH; k++) {
        r2[k] = jet_square(x, k) + jet_square(y, k);
        L_L[k] = r2[k] - jet_square(a, k);
        q2[k] = jet_square_root(L_L, q2, k);
        direction[k] = jet_atan2(y, x, r2, direction, k);
        slant[k] = jet_atan2(a, q2, r2, slant, k);
        q1[k] = direction[k] - slant[k];
    }
    q1[0] = at.q[0]; // not full turns beside it
}

/* No pole is nearer than the time (s) in which the point could come as near as a to the joint, also
 * on complex ways: r_0 - speed t - g t^2 / 2 = |a|. */
static double time_to_pole(void) {
    const struct rp_parameters *p = &at.parameters;
    const double way = hypot(at.q[1], p->a) - fabs(p->a);
    const double speed = hypot(at.dq[1] - p->a * at.dq[0], at.q[1] * at.dq[0]);
    return 2.0 * way / (speed + sqrt(speed * speed + 2.0 * fabs(p->g) * way));
}

static void test_flight_on_a_parabola(void) {
    struct rp_parameters *p = &at.parameters;
    p->m1 = p->I1z = p->I2z = p->l1 = 0.0;
    for (int n = 0; n < SAMPLES; n++) {
        p->a = n % 2 == 0 ? 0.0 : rp_test_uniform(&random_source, -0.5, 0.5);
        p->g = n % 3 == 0 ? 0.0 : rp_test_uniform(&random_source, -10.0, 10.0);
        p->m2 = rp_test_uniform(&random_source, 0.5, 2.0);
        at.q[0] = rp_test_uniform(&random_source, -3.0, 3.0);
        at.q[1] = rp_test_uniform(&random_source, 1.0, 2.0);
        at.dq[0] = rp_test_uniform(&random_source, -1.0, 1.0);
        at.dq[1] = rp_test_uniform(&random_source, -1.0, 1.0);
        time_scale = time_to_pole();
        expand();
        jet q1, q2, scale;
        parabola(q1, q2);
        for (int k = 0; k < SERIES_LENGTH; k++) {
            scale[k] = 4.0 / time_scale;
        }
        assert_rows(q1, q2, scale, 64.0);
    }
}

/* ---- Energy --------------------------------------------------------------------------------- */

/* Energies of a motion of which q1, q2, q1', q2', J, L and the sine and cosine are known, and the
 * power of the efforts. */
struct energies {
    jet along_slide, dq1_dq1, total, power;
};

static void energies_of(double minus, const struct motion *m, struct energies *e) {
    const struct rp_parameters *p = &at.parameters;
    const double a = term(minus, p->a);
    const double g = term(minus, p->g);
    jet efforts[2];
    for (int k = 0; k <= ORDER; k++) {
        for (int i = 0; i < 2; i++) {
            efforts[i][k] = k < SERIES_INPUT_LENGTH ? term(minus, inputs[i][k]) : 0.0;
        }
        e->along_slide[k] = m->dq2[k] + minus * a * m->dq1[k];
        e->dq1_dq1[k] = jet_square(m->dq1, k);
        const double kinetic =
            0.5 * (jet_product(m->J, e->dq1_dq1, k) + p->m2 * jet_square(e->along_slide, k));
        const double height2 = jet_product(m->L, m->s, k) + a * m->c[k];
        e->total[k] = kinetic + g * (p->m1 * p->lc1 * m->s[k] + p->m2 * height2);
        e->power[k] = jet_product(efforts[0], m->dq1, k) + jet_product(efforts[1], m->dq2, k);
    }
}

/* The motion that the series gives. */
static void read_motion(struct motion *m) {
    begin(textbook, m);
    memcpy(m->q1, row[Q1], sizeof m->q1);
    memcpy(m->q2, row[Q2], sizeof m->q2);
    memcpy(m->dq1, row[W], sizeof m->dq1);
    memcpy(m->dq2, row[V], sizeof m->dq2);
    for (int k = 1; k <= ORDER; k++) {
        m->L[k] = m->q2[k];
        m->J[k] = at.parameters.m2 * jet_square(m->L, k);
        jet_sine_cosine(m->q1, m->s, m->c, k);
    }
}

static void test_energy_grows_by_the_work_of_the_efforts(void) {
    static struct motion motion, bounding;
    static struct energies found, bound;
    for (int n = 0; n < SAMPLES; n++) {
        next_sample();
        if (n % 2 == 0) { // none: it is constant
            memset(inputs, 0, sizeof inputs);
        }
        expand();
        read_motion(&motion);
        energies_of(textbook, &motion, &found);
        expand_by_jets(majorant, ORDER, &bounding);
        bounding.J[0] = fabs(bounding.J[0]);
        for (int k = 1; k <= ORDER; k++) {
            bounding.J[k] = fabs(bounding.J[k]);
        }
        energies_of(majorant, &bounding, &bound);
        for (int k = 1; k <= ORDER; k++) {
            ASSERT_CLOSE(jet_integral(found.power, time_scale, k), found.total[k],
                         8.0 * k * EPS * bound.total[k]);
        }
    }
}
