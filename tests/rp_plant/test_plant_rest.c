/* Two joints at rest: one pattern fits, and it is the minimum of Gauss' principle.
 *
 * 200 000 random cases; those in which a pattern fits or fails by no more than rounding are drawn
 * again, and there are few. */
#include "plant_test_support.h"
#include "rp_plant_equations.h"
#include "rp_plant_modes.h"
#include "unity.h"

#include <math.h>

enum { CASES = 200000 };

static struct rp_test_random random_source;

void setUp(void) {
    random_source.state = 41;
}

static int below(int count) {
    return (int)(rp_test_random_bits(&random_source) % (unsigned)count);
}

static double decades(double low, double high) {
    return pow(10.0, rp_test_uniform(&random_source, low, high));
}

static void next_case(struct rp_plant_rest *rest) {
    plant_test_random_inertia(&random_source, &rest->inertia);
    for (int i = 0; i < 2; i++) {
        const double size = sqrt(rest->inertia.D[i][i]) * decades(-0.5, 0.5);
        rest->forces[i] = size * rp_test_uniform(&random_source, -2.0, 2.0);
        rest->breakaway[i] = below(8) == 0 ? 0.0 : size;
        rest->at_rest[i] = below(8) != 0;
        rest->closed[i] = rest->at_rest[i] && below(2) == 0 ? 1 - 2 * below(2) : 0;
    }
}

/* Patterns that fit; -1: one of them by rounding only. */
static int patterns_that_fit(const struct rp_plant_rest *rest, struct rp_plant_outcome *fitting) {
    int found = 0;
    for (int i = -1; i <= 1; i++) {
        for (int j = -1; j <= 1; j++) {
            if ((i != 0 && !rest->at_rest[0]) || (j != 0 && !rest->at_rest[1])) {
                continue;
            }
            struct rp_plant_outcome outcome;
            const int pattern[2] = {i, j};
            const double misfit = rp_plant_rest_misfit(rest, pattern, &outcome);
            if (fabs(misfit) < 1e-12) {
                return -1;
            }
            if (misfit < 0.0) {
                found++;
                *fitting = outcome;
            }
        }
    }
    return found;
}

static void test_exactly_one_pattern_fits(void) {
    int drawn_again = 0;
    int of_pattern[3][3] = {{0}};
    for (int n = 0; n < CASES; n++) {
        struct rp_plant_rest rest;
        struct rp_plant_outcome fitting;
        struct rp_plant_outcome decided;
        int found;
        do {
            next_case(&rest);
            found = patterns_that_fit(&rest, &fitting);
            drawn_again += found < 0;
        } while (found < 0);
        TEST_ASSERT_EQUAL_INT(1, found);
        rp_plant_rest_decide(&rest, &decided);
        for (int i = 0; i < 2; i++) {
            TEST_ASSERT_EQUAL_INT(fitting.pattern[i], decided.pattern[i]);
            ASSERT_SAME(fitting.ddq[i], decided.ddq[i]);
            ASSERT_SAME(fitting.reaction[i], decided.reaction[i]);
        }
        of_pattern[decided.pattern[0] + 1][decided.pattern[1] + 1]++;
    }
    TEST_ASSERT_LESS_OR_EQUAL_INT(CASES / 100, drawn_again);
    for (int i = 0; i < 9; i++) {
        TEST_ASSERT_GREATER_THAN_INT(CASES / 100, of_pattern[i / 3][i % 3]);
    }
}

/* a^T D a / 2 - b^T a + sum of F |a| */
static double gauss_function(const struct rp_plant_rest *rest, const double a[2]) {
    const double(*D)[2] = rest->inertia.D;
    double sum = 0.5 * (D[0][0] * a[0] * a[0] + D[1][1] * a[1] * a[1]) + D[0][1] * a[0] * a[1];
    for (int i = 0; i < 2; i++) {
        const double friction = rest->at_rest[i] ? rest->breakaway[i] * fabs(a[i]) : 0.0;
        sum += friction - rest->forces[i] * a[i];
    }
    return sum;
}

static void test_no_allowed_acceleration_is_better(void) {
    for (int n = 0; n < CASES / 10; n++) {
        struct rp_plant_rest rest;
        struct rp_plant_outcome outcome;
        next_case(&rest);
        rp_plant_rest_decide(&rest, &outcome);
        const double least = gauss_function(&rest, outcome.ddq);
        for (int k = 0; k < 10; k++) {
            double other[2];
            for (int i = 0; i < 2; i++) {
                const double size = decades(-4.0, 1.0);
                other[i] = outcome.ddq[i] + size * rp_test_uniform(&random_source, -1.0, 1.0);
                if (rest.closed[i] * other[i] < 0.0) {
                    other[i] = 0.0;
                }
            }
            const double value = gauss_function(&rest, other);
            TEST_ASSERT_TRUE(value >= least - 1e-13 * (fabs(least) + fabs(value)));
        }
    }
}

/* A force exactly at the limit does not move the joint; the next double does. */
static void test_at_the_limit_the_joint_stays(void) {
    struct rp_plant_rest rest = {
        .inertia = {.D = {{2.0, 0.0}, {0.0, 3.0}}, .determinant = 6.0},
        .forces = {5.0, -4.0},
        .breakaway = {5.0, 4.0},
        .at_rest = {true, true},
    };
    struct rp_plant_outcome outcome;
    rp_plant_rest_decide(&rest, &outcome);
    TEST_ASSERT_EQUAL_INT(0, outcome.pattern[0]);
    TEST_ASSERT_EQUAL_INT(0, outcome.pattern[1]);
    ASSERT_SAME(5.0, outcome.reaction[0]);
    ASSERT_SAME(-4.0, outcome.reaction[1]);

    rest.forces[0] = nextafter(5.0, 6.0);
    rest.forces[1] = nextafter(-4.0, -5.0);
    rp_plant_rest_decide(&rest, &outcome);
    TEST_ASSERT_EQUAL_INT(1, outcome.pattern[0]);
    TEST_ASSERT_EQUAL_INT(-1, outcome.pattern[1]);
    ASSERT_SAME((rest.forces[0] - 5.0) / 2.0, outcome.ddq[0]);
    ASSERT_SAME((rest.forces[1] + 4.0) / 3.0, outcome.ddq[1]);
}

static void test_a_closed_stop_takes_what_friction_cannot(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        const double breakaway = below(4) == 0 ? 0.0 : decades(-1.0, 1.0);
        const double reaction = rp_test_uniform(&random_source, -20.0, 20.0);
        for (int closed = -1; closed <= 1; closed += 2) {
            const struct plant_hold hold = plant_split(reaction, breakaway, closed);
            ASSERT_CLOSE(reaction, hold.friction - hold.stop, 1e-14 * (20.0 + breakaway));
            TEST_ASSERT_TRUE(closed * hold.stop >= 0.0);
            if (closed * reaction < -breakaway) {
                TEST_ASSERT_TRUE(fabs(hold.friction) == breakaway && hold.stop != 0.0);
            } else {
                TEST_ASSERT_TRUE(hold.friction == reaction && hold.stop == 0.0);
            }
        }
    }
}

/* Forces at which a pattern just fits, to rounding: what is decided then misses the conditions by
 * no more than rounding. */
static void test_decisions_at_the_limits(void) {
    for (int n = 0; n < CASES; n++) {
        struct rp_plant_rest rest;
        struct rp_plant_outcome outcome;
        double a[2];
        double held[2];
        next_case(&rest);
        for (int i = 0; i < 2; i++) {
            // stays at its limit, or leaves with an acceleration or none
            const int direction = rest.closed[i] != 0 ? rest.closed[i] : 1 - 2 * below(2);
            rest.at_rest[i] = true;
            held[i] = direction * rest.breakaway[i];
            a[i] = below(2) == 0 ? 0.0 : direction * decades(-14.0, 1.0);
        }
        const double(*D)[2] = (const double(*)[2])rest.inertia.D;
        for (int i = 0; i < 2; i++) {
            rest.forces[i] = D[i][0] * a[0] + D[i][1] * a[1] + held[i];
        }
        rp_plant_rest_decide(&rest, &outcome);
        const double misfit = rp_plant_rest_misfit(&rest, outcome.pattern, &outcome);
        TEST_ASSERT_TRUE(misfit <= 1e-14);
        for (int i = 0; i < 2; i++) {
            const double size =
                fabs(rest.forces[0]) + fabs(rest.forces[1]) + rest.breakaway[0] + rest.breakaway[1];
            const double inverse = (D[0][0] + D[1][1]) / rest.inertia.determinant;
            ASSERT_CLOSE(a[i], outcome.ddq[i], 1e-14 * inverse * size);
        }
    }
}

/* Friction that exceeds the forces at any angle holds: the decision says the same. */
static void test_joints_that_surely_hold_stay(void) {
    static struct rp_plant_values v;
    int holding = 0;
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        plant_test_random_plant(&random_source, &v);
        for (int i = 0; i < 2; i++) {
            v.dq[i] = 0.0;
            v.modes.joint[i] = RP_PLANT_STUCK;
            v.modes.contact[i] = RP_PLANT_APART;
            v.parameters.breakaway_friction[i] = 100.0 * decades(-1.0, 1.0);
        }
        v.modes.payload = RP_PLANT_RELEASED;
        v.payload_attached = 0;
        if (rp_plant_surely_holds(&v)) {
            holding++;
            v.modes.payload = RP_PLANT_UNDECIDED; // an update decides all
            plant_test_update(&v, -1);
            TEST_ASSERT_EQUAL_INT(RP_PLANT_STUCK, v.modes.joint[0]);
            TEST_ASSERT_EQUAL_INT(RP_PLANT_STUCK, v.modes.joint[1]);
        }
    }
    TEST_ASSERT_GREATER_THAN_INT(RP_TEST_SAMPLES / 10, holding);
}
