/* What an update of any plant promises, through struct model: velocities jump by the laws of impact
 * and grasp, with momenta and energy; who moves follows by Gauss' principle; modes and indicators
 * fit what comes next. test_plant_events.c has single cases. */
#include "last_text.h"
#include "plant_test_support.h"
#include "unity.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define EPS DBL_EPSILON

enum { SAMPLES = 20 * RP_TEST_SAMPLES };

static const struct model_events *events;
static struct rp_test_random random_source;
static struct rp_plant_values v, before;

void setUp(void) {
    events = rp_plant_model.events;
    random_source.state = 61;
}

static double uniform(double low, double high) {
    return rp_test_uniform(&random_source, low, high);
}

static int below(int count) {
    return (int)(rp_test_random_bits(&random_source) % (unsigned)count);
}

/* The side of the rigid stop that a joint is on: +1 the lower one, -1 the upper one, 0 none. */
static int side_of(int i) {
    const struct rp_plant_parameters *p = &v.parameters;
    if (p->stops[i] != RP_PLANT_STOPS_RIGID) {
        return 0;
    }
    return v.q[i] == p->lower[i] ? 1 : v.q[i] == p->upper[i] ? -1 : 0;
}

static double breakaway_of(int i) {
    return fmax(v.parameters.breakaway_friction[i], v.parameters.coulomb_friction[i]);
}

static bool rests(int i) {
    return v.dq[i] == 0.0 && (breakaway_of(i) > 0.0 || side_of(i) != 0);
}

/* On a stop, in it or between two; at rest, fast, or so slow that it comes back at once. */
static void next_sample(void) {
    plant_test_random_plant(&random_source, &v);
    struct rp_plant_parameters *p = &v.parameters;
    v.modes.payload = RP_PLANT_UNDECIDED;
    const int slow = below(8); // one joint at most
    for (int i = 0; i < 2; i++) {
        const int kind = below(5), place = below(3);
        p->restitution[i] = below(2) == 0 ? uniform(0.0, 1.0) : below(2);
        p->stops[i] = kind == 0  ? RP_PLANT_STOPS_NONE
                      : kind < 3 ? RP_PLANT_STOPS_RIGID
                                 : RP_PLANT_STOPS_COMPLIANT;
        p->lower[i] = place == 0 ? v.q[i] : v.q[i] - 0.5;
        p->upper[i] = place == 1 ? v.q[i] : v.q[i] + 0.5;
        if (p->stops[i] == RP_PLANT_STOPS_COMPLIANT) {
            p->stop_stiffness[i] = 300.0;
            p->stop_damping[i] = 0.25 * below(4);
            v.q[i] += 0.75 * (below(3) - 1);
        }
        v.dq[i] *= below(2) == 0 ? 0.0 : i == slow ? 1e-9 : 1.0;
    }
}

/* ---- Impacts -------------------------------------------------------------------------------- */

/* Or 0: no joint that is kicked off its stop comes back at once. */
static bool is_fast(double dq) {
    return dq == 0.0 || fabs(dq) > 1e-2;
}

/* P = D (q'+ - q'-), pushes joints away from their stops, and takes kinetic energy. At each stop
 * P >= 0 and q'+ + e q'- >= 0, one of them 0, unless a joint that was leaving is driven back, which
 * is the next impact, or a bounce is too low to be one. */
static void assert_law_of_impact(void) {
    const double(*D)[2] = (const double(*)[2])before.D;
    const double *e = v.parameters.restitution;
    double after[2], energy = 0.0;
    bool is_one_impact = true;
    for (int i = 0; i < 2; i++) {
        double change = 0.0, scale = 0.0;
        for (int j = 0; j < 2; j++) {
            change += D[i][j] * (v.dq[j] - before.dq[j]);
            scale += fabs(D[i][j]) * (fabs(v.dq[j]) + fabs(before.dq[j]));
        }
        ASSERT_CLOSE(change, v.sums.stop_impulse[i], 1e-12 * scale);
        energy += D[i][i] * before.dq[i] * before.dq[i];
        after[i] = side_of(i) * (v.dq[i] + e[i] * before.dq[i]);
        TEST_ASSERT_TRUE(side_of(i) != 0 || v.sums.stop_impulse[i] == 0.0);
        TEST_ASSERT_TRUE(side_of(i) * v.dq[i] >= 0.0);
        is_one_impact = is_one_impact && side_of(i) * before.dq[i] <= 0.0 &&
                        is_fast(before.dq[i]) && is_fast(D[0][1] / D[i][i] * before.dq[1 - i]) &&
                        (v.dq[i] != 0.0 || e[i] * before.dq[i] == 0.0);
    }
    TEST_ASSERT_TRUE(v.sums.impact_loss >= 0.0);
    ASSERT_CLOSE(before.kinetic_energy - v.kinetic_energy, v.sums.impact_loss, 1e-12 * energy);
    if (!is_one_impact) {
        return;
    }
    TEST_ASSERT_TRUE(e[0] < 1.0 || e[1] < 1.0 || v.sums.impact_loss == 0.0);
    for (int i = 0; i < 2; i++) {
        const double push = side_of(i) * v.sums.stop_impulse[i];
        TEST_ASSERT_TRUE(push >= 0.0 && after[i] >= -16 * EPS * (fabs(v.dq[i]) + 10.0));
        if (push > 0.0) {
            ASSERT_SAME(-e[i] * before.dq[i], v.dq[i]);
        }
    }
}

/* ---- Modes ---------------------------------------------------------------------------------- */

static void assert_modes_fit(void) {
    const bool jumps = memcmp(before.dq, v.dq, sizeof v.dq) != 0;
    TEST_ASSERT_TRUE(events->modes_are_possible(&v, true));
    for (int i = 0; i < 2; i++) {
        const int mode = v.modes.joint[i], side = side_of(i);
        const double moves = v.dq[i] != 0.0 ? v.dq[i] : v.ddq[i];
        if (mode == RP_PLANT_STUCK) {
            TEST_ASSERT_TRUE(v.dq[i] == 0.0 && v.ddq[i] == 0.0);
        } else {
            TEST_ASSERT_TRUE(mode == RP_PLANT_FREE || mode * moves > 0.0);
            TEST_ASSERT_TRUE(side * moves >= 0.0);
        }
        const bool is_low = v.q[i] == v.parameters.lower[i];
        if (v.parameters.stops[i] == RP_PLANT_STOPS_COMPLIANT && v.dq[i] == 0.0 &&
            (is_low || v.q[i] == v.parameters.upper[i])) { // pushed if it moves into the stop
            const int pushed = is_low ? RP_PLANT_PUSHED : -RP_PLANT_PUSHED;
            TEST_ASSERT_EQUAL_INT(pushed * moves < 0.0 ? pushed : 0, v.modes.contact[i]);
        }
        // no joint leaves its stop to come back from less than the tolerance
        const double into = -side * v.ddq[i];
        TEST_ASSERT_TRUE(jumps || !(side * v.dq[i] > 0.0 && into > 0.0) ||
                         v.dq[i] * v.dq[i] > 2.0 * into * 0.999e-10);
    }
}

static void assert_indicators_fit(void) {
    double z[RP_PLANT_INDICATORS], u[PLANT_INPUTS];
    const double x[PLANT_STATES] = {v.q[0], v.q[1], v.dq[0], v.dq[1]};
    struct indicator described[RP_PLANT_INDICATORS];
    memcpy(u, &v.inputs, sizeof u);
    ASSERT_OK(events->indicators(&v, 3.0, x, u, z));
    events->describe(&v, described);
    for (int k = 0; k < RP_PLANT_INDICATORS; k++) {
        const struct indicator *indicator = &described[k];
        TEST_ASSERT_TRUE(z[k] >= 0.0);
        ASSERT_SAME(v.indicators[k], z[k]);
        if (indicator->kind == INDICATOR_OF_STATE) {
            ASSERT_SAME(indicator->offset + indicator->factor * x[indicator->state], z[k]);
        } else if (indicator->kind == INDICATOR_UNUSED) {
            ASSERT_SAME(1.0, z[k]);
        } else {
            TEST_ASSERT_EQUAL_INT(RP_PLANT_STUCK, v.modes.joint[k / 4]);
            TEST_ASSERT_TRUE(k % 4 < 2);
        }
    }
}

/* Until initialization ends, values can be read that the first update does not change. */
static void assert_values_of_before(void) {
    if (memcmp(before.q, v.q, sizeof v.q) == 0 && memcmp(before.dq, v.dq, sizeof v.dq) == 0) {
        for (int i = 0; i < 2; i++) {
            ASSERT_SAME(v.ddq[i], before.ddq[i]);
            ASSERT_SAME(v.friction[i], before.friction[i]);
        }
        ASSERT_SAME(v.kinetic_energy, before.kinetic_energy);
    }
}

/* True if another update is made after a step in which nothing happens. */
static bool is_updated_again(bool is_later) {
    struct indicator first[RP_PLANT_INDICATORS] = {0};
    struct indicator second[RP_PLANT_INDICATORS] = {0};
    events->describe(&v, first);
    if (is_later) {
        v.q[1] += v.modes.joint[1] == RP_PLANT_STUCK ? 0.0 : 0.125;
        v.dq[0] *= 0.5;
        v.dq[1] *= below(2) == 0 ? 2.0 : -0.5;
        v.inputs.tau[0] *= -1.0;
        if (!events->moves_on(&v)) {
            return false;
        }
    }
    const struct rp_plant_values once = v;
    plant_test_update(&v, -1);
    TEST_ASSERT_EQUAL_MEMORY(&once, &v, sizeof v);
    events->describe(&v, second);
    for (int k = 0; k < RP_PLANT_INDICATORS; k++) {
        TEST_ASSERT_TRUE(first[k].kind == second[k].kind && first[k].state == second[k].state &&
                         first[k].factor == second[k].factor &&
                         first[k].offset == second[k].offset && first[k].rises == second[k].rises);
    }
    return is_later;
}

/* ---- Gauss' principle ----------------------------------------------------------------------- */

/* a^T D a / 2 - b^T a + sum of F |a|, where b are all forces but friction and rigid stops of joints
 * at rest. */
static double gauss_function(const double a[2]) {
    double sum = 0.0;
    for (int i = 0; i < 2; i++) {
        double b = 0.0;
        for (int j = 0; j < 2; j++) {
            b += v.D[i][j] * v.ddq[j];
            sum += 0.5 * a[i] * v.D[i][j] * a[j];
        }
        if (rests(i)) {
            b += v.friction[i] - (side_of(i) != 0 ? v.stop_force[i] : 0.0);
            sum += breakaway_of(i) * fabs(a[i]);
        }
        sum -= b * a[i];
    }
    return sum;
}

static void assert_no_allowed_acceleration_is_better(void) {
    const double least = gauss_function(v.ddq);
    for (int k = 0; k < 5; k++) {
        double other[2];
        for (int i = 0; i < 2; i++) {
            other[i] = v.ddq[i] + pow(10.0, uniform(-4.0, 1.0)) * uniform(-1.0, 1.0);
            if (rests(i) && side_of(i) * other[i] < 0.0) {
                other[i] = 0.0;
            }
        }
        const double value = gauss_function(other);
        TEST_ASSERT_TRUE(value >= least - 1e-12 * (fabs(least) + fabs(value)));
    }
}

static int sign_of(double x) {
    return (x > 0.0) - (x < 0.0);
}

static void test_what_an_update_leaves(void) {
    int moved_on = 0;
    int of_pattern[3][3] = {{0}}; // backward, at rest, forward
    for (int n = 0; n < SAMPLES; n++) {
        next_sample();
        plant_test_outputs(&v);
        before = v;
        plant_test_update(&v, -1);
        plant_test_outputs(&v);
        assert_law_of_impact();
        assert_modes_fit();
        assert_indicators_fit();
        assert_values_of_before();
        assert_no_allowed_acceleration_is_better();
        if (rests(0) && rests(1)) {
            of_pattern[sign_of(v.ddq[0]) + 1][sign_of(v.ddq[1]) + 1]++;
        }
        moved_on += is_updated_again(n % 2 == 0);
    }
    TEST_ASSERT_GREATER_THAN_INT(0, moved_on);
    for (int i = 0; i < 9; i++) {
        TEST_ASSERT_GREATER_THAN_INT(SAMPLES / 1000, of_pattern[i / 3][i % 3]);
    }
}

/* Forces at which joints just stay or leave, to rounding, with an acceleration or none. */
static void test_decisions_at_the_limits(void) {
    for (int n = 0; n < SAMPLES; n++) {
        double a[2], held[2], size = 0.0;
        next_sample();
        memset(v.inputs.wrench, 0, sizeof v.inputs.wrench);
        for (int i = 0; i < 2; i++) {
            v.parameters.stops[i] = RP_PLANT_STOPS_NONE + below(2);
            v.q[i] = fmin(fmax(v.q[i], v.parameters.lower[i]), v.parameters.upper[i]);
            v.dq[i] = 0.0;
            const int direction = side_of(i) != 0 ? side_of(i) : 1 - 2 * below(2);
            held[i] = direction * breakaway_of(i);
            a[i] = below(2) == 0 ? 0.0 : direction * pow(10.0, uniform(-14.0, 1.0));
        }
        plant_test_outputs(&v);
        for (int i = 0; i < 2; i++) {
            v.inputs.tau[i] = v.D[i][0] * a[0] + v.D[i][1] * a[1] + held[i] + v.gravity[i];
            size += fabs(v.inputs.tau[i]) + fabs(held[i]) + fabs(v.gravity[i]);
        }
        plant_test_update(&v, n % 13 < RP_PLANT_INDICATORS ? n % 13 : -1);
        plant_test_outputs(&v);
        TEST_ASSERT_TRUE(events->modes_are_possible(&v, true));
        const double(*D)[2] = (const double(*)[2])v.D;
        const double determinant = D[0][0] * D[1][1] - D[0][1] * D[0][1];
        for (int i = 0; i < 2; i++) {
            ASSERT_CLOSE(a[i], v.ddq[i], 1e-14 * (D[0][0] + D[1][1]) / determinant * size);
        }
    }
}

/* Friction that exceeds the forces at any angle holds, and moves on; a decision says the same. */
static void test_joints_that_surely_hold_stay(void) {
    int holding = 0;
    for (int n = 0; n < SAMPLES; n++) {
        plant_test_random_plant(&random_source, &v);
        for (int i = 0; i < 2; i++) {
            v.dq[i] = 0.0;
            v.modes.joint[i] = RP_PLANT_STUCK;
            v.parameters.breakaway_friction[i] = pow(10.0, uniform(1.0, 3.0));
        }
        if (events->moves_on(&v)) {
            holding++;
            v.modes.payload = RP_PLANT_UNDECIDED; // an update decides all
            plant_test_update(&v, -1);
            TEST_ASSERT_EQUAL_INT(RP_PLANT_STUCK, v.modes.joint[0]);
            TEST_ASSERT_EQUAL_INT(RP_PLANT_STUCK, v.modes.joint[1]);
        }
    }
    TEST_ASSERT_GREATER_THAN_INT(SAMPLES / 20, holding);
}

/* ---- Grasp ---------------------------------------------------------------------------------- */

static void test_a_grasp_at_rest_keeps_the_momenta_of_the_joints(void) {
    for (int n = 0; n < SAMPLES / 2; n++) {
        plant_test_random_plant(&random_source, &v);
        v.parameters.grasp = RP_PLANT_GRASP_AT_REST;
        v.modes.payload = RP_PLANT_RELEASED;
        v.payload_attached = 0;
        plant_test_outputs(&v);
        before = v;
        v.payload_attached = 1;
        plant_test_update(&v, -1);
        plant_test_outputs(&v);
        const double determinant = v.D[0][0] * v.D[1][1] - v.D[0][1] * v.D[0][1];
        const double condition = v.D[0][0] * v.D[1][1] / determinant;
        double energy = 0.0;
        for (int i = 0; i < 2; i++) {
            double kept = 0.0, scale = 0.0;
            for (int j = 0; j < 2; j++) {
                kept += v.D[i][j] * v.dq[j] - before.D[i][j] * before.dq[j];
                scale += fabs(v.D[i][j]) * (fabs(v.dq[j]) + fabs(before.dq[j]));
            }
            ASSERT_CLOSE(0.0, kept, 32 * EPS * condition * scale);
            energy += v.D[i][i] * before.dq[i] * before.dq[i];
        }
        TEST_ASSERT_TRUE(v.sums.grasp_loss >= 0.0);
        ASSERT_CLOSE(before.kinetic_energy - v.kinetic_energy, v.sums.grasp_loss,
                     64 * EPS * condition * energy);
    }
}

/* By choice; before the first event, as the payload then belongs to link 2; and where parameters
 * change while it is attached, as those of the arm. */
static void test_where_velocities_stay(void) {
    const struct {
        int grasp, mode;
        double added; /* kg */
    } cases[] = {{RP_PLANT_GRASP_KEEP_VELOCITY, RP_PLANT_RELEASED, 0.0},
                 {RP_PLANT_GRASP_AT_REST, RP_PLANT_UNDECIDED, 0.0},
                 {RP_PLANT_GRASP_AT_REST, RP_PLANT_ATTACHED, 2.0}};
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        plant_test_random_plant(&random_source, &v);
        v.parameters.grasp = cases[n].grasp;
        v.modes.payload = cases[n].mode;
        v.payload_attached = 1;
        v.parameters.payload_mass += cases[n].added;
        v.parameters.payload_x += 0.125 * cases[n].added;
        before = v;
        plant_test_update(&v, -1);
        TEST_ASSERT_EQUAL_INT(RP_PLANT_ATTACHED, v.modes.payload);
        TEST_ASSERT_EQUAL_MEMORY(before.dq, v.dq, sizeof v.dq);
        ASSERT_SAME(0.0, v.sums.grasp_loss);
    }
}
