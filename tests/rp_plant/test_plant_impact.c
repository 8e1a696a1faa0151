/* Velocities that jump: impacts at one stop and at two by the law, momentum and energy; the grasp
 * of a payload at rest by momenta and energy. */
#include "plant_test_support.h"
#include "rp_plant_impact.h"
#include "unity.h"

#include <float.h>
#include <math.h>

#define EPS DBL_EPSILON

enum { CASES = 100000 };

static struct rp_test_random random_source;
static struct rp_plant_inertia inertia;
static struct rp_plant_contacts contacts;
static struct rp_plant_impact impact;
static double before[2];
static struct rp_plant_values v;

void setUp(void) {
    random_source.state = 43;
}

static double restitution(void) {
    switch (rp_test_random_bits(&random_source) % 4) {
    case 0:
        return 0.0;
    case 1:
        return 1.0;
    default:
        return rp_test_uniform(&random_source, 0.0, 1.0);
    }
}

/* Both joints into a stop of theirs, or resting on it, or without a stop. */
static void next_sample(void) {
    plant_test_random_inertia(&random_source, &inertia);
    for (int i = 0; i < 2; i++) {
        const bool rests = rp_test_random_bits(&random_source) % 8 == 0;
        before[i] = rests ? 0.0 : rp_test_uniform(&random_source, -5.0, 5.0);
        const bool is_free = rp_test_random_bits(&random_source) % 8 == 0;
        contacts.side[i] = is_free ? 0 : before[i] > 0.0 ? -1 : 1;
        contacts.restitution[i] = restitution();
    }
}

static double kinetic_energy(const double dq[2]) {
    double(*D)[2] = inertia.D;
    return 0.5 * (D[0][0] * dq[0] * dq[0] + D[1][1] * dq[1] * dq[1]) + D[0][1] * dq[0] * dq[1];
}

/* A bound of all terms, with which errors of the energy are compared. */
static double energy_scale(const double dq[2]) {
    double(*D)[2] = inertia.D;
    return D[0][0] * dq[0] * dq[0] + D[1][1] * dq[1] * dq[1];
}

static void test_impulses_change_the_momenta(void) {
    for (int n = 0; n < CASES; n++) {
        next_sample();
        rp_plant_impact(&inertia, &contacts, before, &impact);
        for (int i = 0; i < 2; i++) {
            double change = 0.0;
            double scale = 0.0;
            for (int j = 0; j < 2; j++) {
                const double term = inertia.D[i][j] * (impact.dq[j] - before[j]);
                change += term;
                scale += fabs(inertia.D[i][j]) * (fabs(impact.dq[j]) + fabs(before[j]));
            }
            ASSERT_CLOSE(change, impact.impulse[i], 16 * EPS * scale);
        }
    }
}

/* At each stop: P >= 0, q'+ + e q'- >= 0, and one of them is 0. Without a stop P = 0. */
static void test_law_of_impact_holds(void) {
    int both = 0;
    int single = 0;
    for (int n = 0; n < CASES; n++) {
        next_sample();
        rp_plant_impact(&inertia, &contacts, before, &impact);
        int struck = 0;
        for (int i = 0; i < 2; i++) {
            const double push = contacts.side[i] * impact.impulse[i];
            TEST_ASSERT_TRUE(contacts.side[i] != 0 || impact.impulse[i] == 0.0);
            const double away =
                contacts.side[i] * (impact.dq[i] + contacts.restitution[i] * before[i]);
            TEST_ASSERT_TRUE(push >= 0.0 && away >= -16 * EPS * (fabs(impact.dq[i]) + 10.0));
            if (push > 0.0) {
                ASSERT_SAME(-contacts.restitution[i] * before[i], impact.dq[i]);
                struck++;
            }
        }
        both += struck == 2;
        single += struck == 1;
    }
    TEST_ASSERT_GREATER_THAN_INT(CASES / 10, both);
    TEST_ASSERT_GREATER_THAN_INT(CASES / 10, single);
}

static void test_loss_is_that_of_kinetic_energy_and_never_negative(void) {
    for (int n = 0; n < CASES; n++) {
        next_sample();
        rp_plant_impact(&inertia, &contacts, before, &impact);
        TEST_ASSERT_TRUE(impact.loss >= 0.0);
        const double scale = energy_scale(before) + energy_scale(impact.dq);
        ASSERT_CLOSE(kinetic_energy(before) - kinetic_energy(impact.dq), impact.loss,
                     32 * EPS * scale);
        if (contacts.restitution[0] == 1.0 && contacts.restitution[1] == 1.0) {
            TEST_ASSERT_TRUE(impact.loss == 0.0);
        }
    }
}

static void test_a_joint_that_moves_away_has_no_impact(void) {
    next_sample();
    before[0] = contacts.side[0] * 2.0;
    before[1] = contacts.side[1] * 3.0;
    rp_plant_impact(&inertia, &contacts, before, &impact);
    for (int i = 0; i < 2; i++) {
        ASSERT_SAME(before[i], impact.dq[i]);
        ASSERT_SAME(0.0, impact.impulse[i]);
    }
    ASSERT_SAME(0.0, impact.loss);
}

/* A joint that rests on its stop holds the blow of the other, or is thrown off by it. */
static void test_a_joint_at_rest_on_its_stop(void) {
    inertia = (struct rp_plant_inertia){{{2.0, -1.0}, {-1.0, 1.0}}, 1.0};
    before[0] = 0.0;
    before[1] = -1.0;
    contacts = (struct rp_plant_contacts){{1, 1}, {0.5, 0.5}};
    rp_plant_impact(&inertia, &contacts, before, &impact);
    ASSERT_SAME(0.75, impact.dq[0]); // D11 dq1 + D12 dq2 = 1 before and after
    ASSERT_SAME(0.5, impact.dq[1]);
    ASSERT_SAME(0.0, impact.impulse[0]);
    ASSERT_SAME(0.75, impact.impulse[1]);

    contacts.side[0] = -1;
    rp_plant_impact(&inertia, &contacts, before, &impact);
    ASSERT_SAME(0.0, impact.dq[0]);
    ASSERT_SAME(0.5, impact.dq[1]);
    ASSERT_SAME(-1.5, impact.impulse[0]);
    ASSERT_SAME(1.5, impact.impulse[1]);
    ASSERT_SAME(0.375, impact.loss);
}

/* ---- Grasp ---------------------------------------------------------------------------------- */

static void test_momenta_of_the_joints_are_kept(void) {
    for (int n = 0; n < 10 * RP_TEST_SAMPLES; n++) {
        plant_test_random_plant(&random_source, &v);
        double after[2];
        struct rp_plant_inertia without;
        struct rp_plant_inertia with;
        const double loss = rp_plant_grasp_at_rest(&v.parameters, v.q, v.dq, after);
        rp_plant_inertia(&v.parameters, false, v.q[1], &without);
        rp_plant_inertia(&v.parameters, true, v.q[1], &with);
        const double condition = with.D[0][0] * with.D[1][1] / with.determinant;
        for (int i = 0; i < 2; i++) {
            double kept = 0.0;
            double scale = 0.0;
            for (int j = 0; j < 2; j++) {
                kept += with.D[i][j] * after[j] - without.D[i][j] * v.dq[j];
                scale += fabs(with.D[i][j]) * (fabs(after[j]) + fabs(v.dq[j]));
            }
            ASSERT_CLOSE(0.0, kept, 32 * EPS * condition * scale);
        }
        const double before_energy = rp_plant_kinetic_energy(&v.parameters, false, v.q, v.dq);
        const double after_energy = rp_plant_kinetic_energy(&v.parameters, true, v.q, after);
        TEST_ASSERT_TRUE(loss >= 0.0);
        const double scale = with.D[0][0] * v.dq[0] * v.dq[0] + with.D[1][1] * v.dq[1] * v.dq[1];
        ASSERT_CLOSE(before_energy - after_energy, loss, 64 * EPS * condition * scale);
    }
}

/* By choice; before the first event, as the payload then belongs to link 2; and where parameters
 * change while it is attached, as those of the arm. */
static void test_where_velocities_stay(void) {
    const struct {
        int grasp, mode;
        double added; /* kg */
    } cases[] = {{RP_PLANT_KEEP_VELOCITY, RP_PLANT_RELEASED, 0.0},
                 {RP_PLANT_AT_REST, RP_PLANT_UNDECIDED, 0.0},
                 {RP_PLANT_AT_REST, RP_PLANT_ATTACHED, 2.0}};
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        plant_test_random_plant(&random_source, &v);
        v.parameters.grasp = cases[n].grasp;
        v.modes.payload = cases[n].mode;
        v.payload_attached = 1;
        v.parameters.payload_mass += cases[n].added;
        v.parameters.payload_x += 0.125 * cases[n].added;
        const struct rp_plant_values kept = v;
        plant_test_update(&v, -1);
        TEST_ASSERT_EQUAL_INT(RP_PLANT_ATTACHED, v.modes.payload);
        ASSERT_SAME(kept.dq[0], v.dq[0]);
        ASSERT_SAME(kept.dq[1], v.dq[1]);
        ASSERT_SAME(0.0, v.sums.grasp_loss);
    }
}
