/* Derivatives along curves against numeric ones, the closed forms of the Jacobians and physics.
 *
 * Bounds: majorants() bounds every field and its terms on a complex neighborhood of the sample. A
 * field is analytic there, so that Cauchy's estimate turns its majorant M into the
 * bound M / R of the terms of its first derivative, and into 576 (h / R)^8 M / R for the truncation
 * of the differences; h = R / 128 leaves that far below their rounding. */
#include "last_text.h"
#include "model_test.h"
#include "rp_calculated.h"
#include "rp_test_support.h"
#include "unity.h"

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

#define EPS     DBL_EPSILON
#define SAMPLES 200

/* struct rp_values as an array: the knowns, then the calculated fields. */
#define KNOWNS 14
#define ALL    44
union point {
    struct rp_values v;
    double all[ALL];
};
_Static_assert(sizeof(struct rp_values) == sizeof(union point) &&
                   offsetof(struct rp_values, ddq) == KNOWNS * sizeof(double),
               "struct rp_values has fields that are not tested");

// clang-format off
enum { /* the knowns as a set */
    M1 = 1 << 0, M2 = 1 << 1, I1Z = 1 << 2, I2Z = 1 << 3, L1 = 1 << 4, LC1 = 1 << 5, A = 1 << 6,
    G = 1 << 7, TAU1 = 1 << 8, F2 = 1 << 9, Q1 = 1 << 10, Q2 = 1 << 11, DQ1 = 1 << 12,
    DQ2 = 1 << 13, EVERY = (1 << KNOWNS) - 1
};

static const int depends_on[ALL] = {
    M1, M2, I1Z, I2Z, L1, LC1, A, G, TAU1, F2, Q1, Q2, DQ1, DQ2,
    /* ddq, ee_position, ee_velocity */
    EVERY, EVERY,
    L1 | A | Q1 | Q2, L1 | A | Q1 | Q2,
    L1 | A | Q1 | Q2 | DQ1 | DQ2, L1 | A | Q1 | Q2 | DQ1 | DQ2,
    /* energies, power */
    M1 | M2 | I1Z | I2Z | L1 | LC1 | A | Q2 | DQ1 | DQ2,
    M1 | M2 | L1 | LC1 | A | G | Q1 | Q2,
    EVERY & ~(TAU1 | F2),
    TAU1 | F2 | DQ1 | DQ2,
    /* D, coriolis, gravity */
    M1 | M2 | I1Z | I2Z | L1 | LC1 | A | Q2,
    M2 | A, M2 | A, M2,
    M2 | L1 | Q2 | DQ1 | DQ2, M2 | L1 | Q2 | DQ1,
    M1 | M2 | L1 | LC1 | A | G | Q1 | Q2, M2 | G | Q1,
    /* f1, tau1, f2, tau2 */
    EVERY, 0, M1 | LC1 | G | F2 | Q1 | DQ1,
    0, TAU1, 0,
    EVERY, 0, F2,
    0, EVERY, 0,
};
// clang-format on

static struct rp_test_random random_source;
static union point x;      /* the sample */
static union point bounds; /* its majorants */

void setUp(void) {
    random_source.state = 17;
}
/* The functions whose derivatives are tested. */
static void calculate(union point *point) {
    ASSERT_OK(rp_model.outputs(point, 0.0));
}

static double inertia(void) {
    return rp_test_inertia(&x.v.parameters, x.v.q[1]);
}

/* How far each known may move, the others fixed, before a field has a pole (J or m2 is 0); 1 at
 * most. */
static double radius(int known) {
    const struct rp_parameters *p = &x.v.parameters;
    switch (1 << known) {
    case M1:
        return fmin(1.0, inertia() / (p->lc1 * p->lc1));
    case M2:
        return fmin(1.0, p->m2);
    case I1Z:
    case I2Z:
        return fmin(1.0, inertia());
    case LC1:
        return fmin(1.0, sqrt(inertia() / p->m1));
    case L1:
    case Q2:
        return fmin(1.0, sqrt(inertia() / p->m2));
    default:
        return 1.0;
    }
}

/* What each field and all its terms stay below while no known moves by more than half of its
 * radius and J and m2 keep a quarter of their values: the equations with every sign positive, and
 * twice the bound of sin and cos on the real axis. */
static void majorants(void) {
    union point far = {.all = {0}};
    for (int k = 0; k < KNOWNS; ++k) {
        far.all[k] = fabs(x.all[k]) + 0.5 * radius(k);
    }
    const struct rp_parameters *p = &far.v.parameters;
    double m1 = p->m1, m2 = p->m2, lc1 = p->lc1, a = p->a, g = 2.0 * p->g;
    double q2 = far.v.q[1], dq1 = far.v.dq[0], dq2 = far.v.dq[1], L = p->l1 + q2;
    double J = rp_test_inertia(p, q2), centripetal = dq1 * dq1, coriolis = 2.0 * dq1 * dq2;
    struct rp_values *b = &bounds.v;
    bounds = far;

    b->gravity[0] = b->potential_energy = g * (m1 * lc1 + m2 * (L + a));
    b->gravity[1] = m2 * g;
    b->coriolis[0] = m2 * L * coriolis;
    b->coriolis[1] = m2 * L * centripetal;
    b->ddq[0] = b->tau[0] + a * b->tau[1] + m2 * L * (a * centripetal + coriolis) + b->gravity[0];
    b->ddq[0] /= 0.25 * inertia();
    b->ddq[1] = b->tau[1] / (0.25 * x.v.parameters.m2) + L * centripetal + g + a * b->ddq[0];
    b->ee_position[0] = b->ee_position[1] = 2.0 * (L + a);
    b->ee_velocity[0] = b->ee_velocity[1] = 2.0 * ((L + a) * dq1 + dq2);
    b->kinetic_energy = 0.5 * (J * centripetal + m2 * (dq2 + a * dq1) * (dq2 + a * dq1));
    b->total_energy = b->kinetic_energy + b->potential_energy;
    b->actuator_power = b->tau[0] * dq1 + b->tau[1] * dq2;
    b->D[0][0] = J + m2 * a * a;
    b->D[0][1] = b->D[1][0] = m2 * a;
    b->D[1][1] = m2;

    struct rp_joint_loads *loads = &b->loads;
    loads->f2[0] = m2 * (L * b->ddq[0] + a * centripetal + coriolis + g);
    loads->f2[2] = m2 * (b->ddq[1] + a * b->ddq[0] + L * centripetal + g);
    loads->f1[0] = loads->f2[0] + m1 * (lc1 * b->ddq[0] + g);
    loads->f1[2] = loads->f2[2] + m1 * (lc1 * centripetal + g);
    loads->tau2[1] = q2 * loads->f2[0] + p->I2z * b->ddq[0];
    loads->tau1[1] = loads->tau2[1] + lc1 * loads->f1[0] + (lc1 + p->l1) * loads->f2[0] +
                     a * loads->f2[2] + p->I1z * b->ddq[0];
}

static void next_sample(void) {
    struct rp_test_state state;
    rp_test_random_parameters(&random_source, &x.v.parameters);
    rp_test_random_state(&random_source, &state);
    memcpy(x.v.tau, state.tau, sizeof state.tau);
    memcpy(x.v.q, state.q, sizeof state.q);
    memcpy(x.v.dq, state.dq, sizeof state.dq);
    calculate(&x);
    majorants();
}

/* A random direction, each known by its radius at most. On a grid: l1 + q2, whose rounding a small
 * J would magnify, is then exact on a curve with steps of a power of two. */
static void next_seed(union point *seed) {
    memset(seed, 0, sizeof *seed);
    for (int k = 0; k < KNOWNS; ++k) {
        double speed = radius(k) * rp_test_uniform(&random_source, -1.0, 1.0);
        seed->all[k] = ldexp(rint(ldexp(speed, 22)), -22);
    }
}

/* ---- Against differences -------------------------------------------------------------------- */

/* A known that moves, and a field. */
struct partial {
    int known;
    int field;
};

static double field_at(const void *context, double value) {
    const struct partial *partial = context;
    union point moved = x;
    moved.all[partial->known] = value;
    calculate(&moved);
    return moved.all[partial->field];
}

static void test_first_derivatives_are_those_of_the_plain_functions(void) {
    for (int n = 0; n < SAMPLES; ++n) {
        next_sample();
        for (int k = 0; k < KNOWNS; ++k) {
            union point first = {.all = {0}};
            first.all[k] = 1.0;
            rp_derivatives(&x.v, &first.v, NULL);
            /* the plain functions err by 16 epsilons of their terms, differences by 2.1 / h times
             * that */
            double h = rp_test_power_of_two(0.5 * radius(k)) / 128.0;
            for (int i = KNOWNS; i < ALL; ++i) {
                const struct partial partial = {k, i};
                double expected = rp_test_derivative(field_at, &partial, x.all[k], h);
                ASSERT_CLOSE(expected, first.all[i], 34 * EPS * bounds.all[i] / h);
            }
        }
    }
}

/* x + velocity t + acceleration t^2 / 2 */
struct curve {
    union point velocity;
    union point acceleration;
    int field;
};

static double first_on_curve(const void *context, double t) {
    const struct curve *curve = context;
    union point point = x, first = curve->velocity;
    for (int k = 0; k < KNOWNS; ++k) {
        point.all[k] += t * (curve->velocity.all[k] + 0.5 * t * curve->acceleration.all[k]);
        first.all[k] += t * curve->acceleration.all[k];
    }
    rp_derivatives(&point.v, &first.v, NULL);
    return first.all[curve->field];
}

static void test_second_derivatives_are_those_of_the_first_on_curves(void) {
    for (int n = 0; n < SAMPLES; ++n) {
        struct curve curve;
        next_sample();
        next_seed(&curve.velocity);
        next_seed(&curve.acceleration);
        union point first = curve.velocity, second = curve.acceleration;
        rp_derivatives(&x.v, &first.v, &second.v);

        /* |t| < R moves each known by 1/31 of its radius, and J by less than half of its value.
         * The terms of a first derivative stay below M / R and err by 32 epsilons. */
        const double R = 1.0 / 32.0, h = R / 128.0;
        for (int i = KNOWNS; i < ALL; ++i) {
            curve.field = i;
            double expected = rp_test_derivative(first_on_curve, &curve, 0.0, h);
            ASSERT_CLOSE(expected, second.all[i], 68 * EPS * bounds.all[i] / R / h);
        }
    }
}

/* ---- Against closed forms ------------------------------------------------------------------- */

static void test_first_derivatives_of_the_accelerations_are_the_jacobians(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        struct rp_dynamics_jacobians jacobians;
        next_sample();
        const struct rp_parameters *p = &x.v.parameters;
        rp_dynamics_jacobians(p, x.v.q, x.v.dq, x.v.tau, &jacobians);

        /* sums of the terms, by tau1, f2, q1, q2, dq1, dq2; ddq2 has own ones and a times ddq1's */
        double J = inertia(), m2 = p->m2, a = fabs(p->a), g = fabs(p->g);
        double L = fabs(p->l1 + x.v.q[1]), dq1 = fabs(x.v.dq[0]), dq2 = fabs(x.v.dq[1]);
        double inertial = m2 * dq1 * (a * dq1 + 2.0 * dq2), weight = g * (p->m1 * p->lc1 + m2 * L);
        double ddq1 = (fabs(x.v.tau[0]) + a * fabs(x.v.tau[1]) + L * inertial + weight) / J;
        double by_q2 = inertial + g * m2 + 2.0 * m2 * L * ddq1, by_dq2 = 2.0 * m2 * L * dq1;
        double by_dq1 = a * by_dq2 + 2.0 * m2 * L * dq2;
        const double torque[6] = {1.0, a, weight, by_q2, by_dq1, by_dq2};
        const double own[6] = {0.0, 1.0 / m2, g, dq1 * dq1, 2.0 * L * dq1, 0.0};
        for (int k = 0; k < 6; ++k) {
            union point first = {.all = {0}};
            first.all[8 + k] = 1.0;
            rp_derivatives(&x.v, &first.v, NULL);
            double(*block)[2] = k < 2 ? jacobians.tau : k < 4 ? jacobians.q : jacobians.dq;
            double terms = torque[k] / J;
            ASSERT_CLOSE(block[0][k % 2], first.v.ddq[0], 8 * EPS * terms);
            ASSERT_CLOSE(block[1][k % 2], first.v.ddq[1], 8 * EPS * (a * terms + own[k]));
        }
    }
}

/* ---- Structure ------------------------------------------------------------------------------ */

static void test_derivatives_are_zero_exactly_where_nothing_depends(void) {
    int moved[ALL][KNOWNS] = {{0}};
    for (int n = 0; n < SAMPLES; ++n) {
        next_sample();
        for (int k = 0; k < KNOWNS; ++k) {
            union point first = {.all = {0}}, second = {.all = {0}};
            first.all[k] = second.all[k] = rp_test_uniform(&random_source, 1.0, 2.0);
            rp_derivatives(&x.v, &first.v, &second.v);
            for (int i = 0; i < ALL; ++i) {
                moved[i][k] += first.all[i] != 0.0 || second.all[i] != 0.0;
            }
        }
    }
    /* parameters that are zero hide a dependency in some samples */
    for (int i = 0; i < ALL; ++i) {
        for (int k = 0; k < KNOWNS; ++k) {
            bool depends = (depends_on[i] & 1 << k) != 0;
            TEST_ASSERT_TRUE(depends ? moved[i][k] > SAMPLES / 2 : moved[i][k] == 0);
        }
    }
}

/* ---- Along the motion ----------------------------------------------------------------------- */

/* dE/dt is the power of the actuators and d2E/dt2 its rate; the velocity of the end effector is the
 * rate of its position; what drives the joints changes as the efforts do. */
static void test_motion_obeys_its_balances(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; ++n) {
        next_sample();
        union point first = {.all = {0}}, second = {.all = {0}};
        for (int i = 0; i < 2; ++i) {
            first.v.tau[i] = rp_test_uniform(&random_source, -50.0, 50.0);
            second.v.tau[i] = rp_test_uniform(&random_source, -50.0, 50.0);
            first.v.q[i] = x.v.dq[i];
            first.v.dq[i] = second.v.q[i] = x.v.ddq[i];
        }
        rp_derivatives(&x.v, &first.v, NULL);
        memcpy(second.v.dq, first.v.ddq, sizeof first.v.ddq);
        rp_derivatives(&x.v, &first.v, &second.v);

        /* the terms of dE/dt are powers of the forces that are behind the accelerations */
        const struct rp_parameters *p = &x.v.parameters;
        double force[2], reach = p->l1 + fabs(x.v.q[1]) + fabs(p->a);
        struct rp_test_state state = {.q = {0.0, x.v.q[1]}, .dq = {x.v.dq[0], x.v.dq[1]}};
        memcpy(state.tau, x.v.tau, sizeof state.tau);
        rp_test_force_scale(p, &state, force);
        rp_test_acceleration_scale(p, x.v.q, force, state.ddq);
        rp_test_force_scale(p, &state, force);
        double power = force[0] * fabs(x.v.dq[0]) + force[1] * fabs(x.v.dq[1]);
        ASSERT_CLOSE(x.v.actuator_power, first.v.total_energy, 8 * EPS * power);

        /* second derivatives: each known moves by 1/32 of its radius within R, as on the curves */
        double R = 1.0;
        for (int k = 0; k < KNOWNS; ++k) {
            R = fmin(R, radius(k) / 64.0 / fabs(first.all[k]));
            R = fmin(R, sqrt(radius(k) / 32.0 / fabs(second.all[k])));
        }
        ASSERT_CLOSE(first.v.actuator_power, second.v.total_energy,
                     64 * EPS * bounds.v.total_energy / R / R);
        for (int i = 0; i < 2; ++i) {
            ASSERT_CLOSE(x.v.ee_velocity[i], first.v.ee_position[i],
                         8 * EPS * (reach * fabs(x.v.dq[0]) + fabs(x.v.dq[1])));
            ASSERT_CLOSE(first.v.ee_velocity[i], second.v.ee_position[i],
                         64 * EPS * bounds.v.ee_position[i] / R / R);
        }
        TEST_ASSERT_TRUE(first.v.loads.tau1[1] == first.v.tau[0]);
        TEST_ASSERT_TRUE(second.v.loads.tau1[1] == second.v.tau[0]);
        TEST_ASSERT_TRUE(first.v.loads.f2[2] == first.v.tau[1]);
        TEST_ASSERT_TRUE(second.v.loads.f2[2] == second.v.tau[1]);
    }
}

/* ---- What is read and written --------------------------------------------------------------- */

static void test_calculated_fields_are_written_and_not_read(void) {
    for (int n = 0; n < SAMPLES; ++n) {
        union point first, second;
        next_sample();
        next_seed(&first);
        next_seed(&second);
        model_test_calculated_fields(&rp_model, &x, &first, &second, KNOWNS * sizeof(double));
    }
}

static void test_model_offers_it_to_the_instance(void) {
    next_sample();
    union point first, second, expected_first, expected_second;
    next_seed(&first);
    next_seed(&second);
    expected_first = first;
    expected_second = second;
    rp_derivatives(&x.v, &expected_first.v, &expected_second.v);
    /* the arm does not know the time */
    ASSERT_OK(rp_model.propagate(&x, 3.0, 1.0, &first, &second));
    TEST_ASSERT_EQUAL_MEMORY(&expected_first, &first, sizeof first);
    TEST_ASSERT_EQUAL_MEMORY(&expected_second, &second, sizeof second);
    ASSERT_OK(rp_model.propagate(&x, 3.0, 1.0, &first, NULL));
    TEST_ASSERT_EQUAL_MEMORY(&expected_first, &first, sizeof first);

    /* in the order of the states, the velocities being states themselves */
    double rates[4];
    TEST_ASSERT_EQUAL(rp_model.states.size, sizeof rates);
    TEST_ASSERT_EQUAL(rp_model.derivatives.size, sizeof rates);
    memcpy(rates, (const char *)&x + rp_model.derivatives.offset, sizeof rates);
    TEST_ASSERT_TRUE(rates[0] == x.v.dq[0] && rates[1] == x.v.dq[1]);
    TEST_ASSERT_TRUE(rates[2] == x.v.ddq[0] && rates[3] == x.v.ddq[1]);
}
