/* The series of the plant over short steps, at a closed stop too. test_plant_series.py has all
 * orders, test_plant_fmu.py the manipulator's bits. */
#include "last_text.h"
#include "plant_test_support.h"
#include "unity.h"

#include <math.h>
#include <string.h>

enum { MAX_ROWS = 64 };

typedef double row[SERIES_LENGTH];

static struct rp_test_random random_source;
static struct rp_plant_values plant;
static double time_scale;
static double inputs[PLANT_INPUTS][SERIES_INPUT_LENGTH];
static row rows[MAX_ROWS];

void setUp(void) {
    random_source.state = 37;
}

/* A step over which the series converges fast, and inputs that are not 0 in polynomials over it. */
static void next_step(void) {
    double u[PLANT_INPUTS];
    double dx[PLANT_STATES];
    const double x[PLANT_STATES] = {plant.q[0], plant.q[1], plant.dq[0], plant.dq[1]};
    memcpy(u, &plant.inputs, sizeof u);
    ASSERT_OK(rp_plant_model.right_hand_side(&plant, 3.0, x, u, dx));
    time_scale = 5e-4 / (1.0 + 0.01 * (fabs(dx[2]) + fabs(dx[3])));
    for (int i = 0; i < PLANT_INPUTS; i++) {
        inputs[i][0] = u[i];
        for (int k = 1; k < SERIES_INPUT_LENGTH; k++) {
            const double rate = rp_test_uniform(&random_source, -20.0, 20.0);
            inputs[i][k] = u[i] != 0.0 ? rate * pow(time_scale, k) : 0.0;
        }
    }
}

static void expand(int last, row all[MAX_ROWS]) {
    const struct series_origin origin = {
        .values = &plant,
        .time_scale = time_scale,
        .inputs = (const double(*)[SERIES_INPUT_LENGTH])inputs,
    };
    TEST_ASSERT_LESS_OR_EQUAL_size_t(MAX_ROWS, rp_plant_series.row_count);
    memset(all, 0xff, sizeof(row) * MAX_ROWS); // NaN: what is read has been written
    for (int i = 0; i < 2; i++) {
        all[i][0] = plant.q[i];
        all[2 + i][0] = plant.dq[i];
    }
    ASSERT_OK(rp_plant_series.extend(&origin, 0, last, all));
}

/* ---- Equations of motion -------------------------------------------------------------------- */

enum { DEGREE = 20 };

/* The value at s units; its derivative by s; the sum of the absolute terms of both at s = 1. */
struct sum {
    double value, derivative, size;
};

static struct sum sum_of(const double c[], double s) {
    struct sum sum = {0};
    for (int k = DEGREE; k >= 0; k--) {
        sum.derivative = sum.derivative * s + sum.value;
        sum.value = sum.value * s + c[k];
        sum.size += (k + 1) * fabs(c[k]);
    }
    return sum;
}

static void assert_model_at(double s) {
    double x[PLANT_STATES];
    double u[PLANT_INPUTS];
    double dx[PLANT_STATES];
    double z[RP_PLANT_INDICATORS];
    struct indicator kinds[RP_PLANT_INDICATORS];
    for (int i = 0; i < PLANT_STATES; i++) {
        x[i] = sum_of(rows[i], s).value;
    }
    for (int i = 0; i < 2; i++) {
        const int mode = plant.modes.joint[i];
        if ((mode == RP_PLANT_FORWARD || mode == RP_PLANT_BACKWARD) && mode * x[2 + i] < 0.0) {
            return; // the mode has ended: what friction would be is another matter
        }
    }
    for (int i = 0; i < PLANT_INPUTS; i++) {
        u[i] = inputs[i][0] + s * (inputs[i][1] + s * (inputs[i][2] + s * inputs[i][3]));
    }
    ASSERT_OK(rp_plant_model.right_hand_side(&plant, 3.0, x, u, dx));
    ASSERT_OK(rp_plant_model.events->indicators(&plant, 3.0, x, u, z));
    rp_plant_model.events->describe(&plant, kinds);
    for (int i = 0; i < PLANT_STATES; i++) {
        const struct sum sum = sum_of(rows[i], s);
        ASSERT_CLOSE(dx[i] * time_scale, sum.derivative, 1e-11 * (time_scale + sum.size));
    }
    for (int i = 0; i < RP_PLANT_INDICATORS; i++) {
        if (kinds[i].kind == INDICATOR_OF_MODEL) {
            const struct sum sum = sum_of(rows[rp_plant_series.row_of_indicator[i]], s);
            ASSERT_CLOSE(z[i], sum.value, 1e-11 * (100.0 + sum.size));
        }
    }
}

static void test_the_polynomials_satisfy_the_equations(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        plant_test_random_plant(&random_source, &plant);
        if (n % 3 == 0) { // on a stop
            plant.parameters.stops[n % 2] = RP_PLANT_STOPS_RIGID;
            plant.parameters.lower[n % 2] = plant.q[n % 2];
            plant.parameters.upper[n % 2] = plant.q[n % 2] + 1.0;
            plant.dq[n % 2] = 0.0;
            plant.modes.joint[n % 2] = RP_PLANT_STUCK;
        } else if (n % 3 == 1) {
            plant_test_random_contacts(&random_source, &plant);
        } else if (n % 9 == 2) { // Coulomb friction alone: the manipulator's series
            plant_test_random_arm(&random_source, &plant);
            plant.parameters.coulomb_friction[0] = 2.0;
            plant.parameters.coulomb_friction[1] = 3.0;
            plant.modes.joint[0] = RP_PLANT_FORWARD;
            plant.modes.joint[1] = RP_PLANT_BACKWARD;
            plant.modes.payload = RP_PLANT_RELEASED;
        }
        next_step();
        expand(DEGREE, rows);
        assert_model_at(1.0);
    }
}

static void test_modes_that_are_not_decided_yet(void) {
    for (int n = 0; n < RP_TEST_SAMPLES; n++) {
        plant_test_random_plant(&random_source, &plant);
        plant.modes = (struct rp_plant_modes){.payload = RP_PLANT_UNDECIDED};
        plant.dq[n % 2] = 0.0;
        next_step();
        expand(DEGREE, rows);
        assert_model_at(0.0);
    }
}

/* ---- Steps ---------------------------------------------------------------------------------- */

static void assert_reach(double expected, double dq2) {
    double reach[PLANT_STATES];
    const double x[PLANT_STATES] = {1.0, 2.0, 3.0, dq2};
    rp_plant_reach(&plant, x, reach);
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_TRUE(reach[i] == INFINITY);
    }
    TEST_ASSERT_TRUE(reach[3] == INFINITY ? expected == INFINITY
                                          : fabs(reach[3] - expected) < 1e-14);
}

/* Where friction depends on the velocity, it changes by vs at most, but 6 vs from rest. */
static void test_reach_of_a_velocity(void) {
    plant_test_start(&plant);
    plant.modes =
        (struct rp_plant_modes){{RP_PLANT_FORWARD, RP_PLANT_FORWARD}, RP_PLANT_RELEASED, {0, 0}};
    plant.parameters.coulomb_friction[1] = 1.0;
    plant.parameters.stribeck_velocity[1] = 0.25;
    assert_reach(INFINITY, 0.5);
    plant.parameters.breakaway_friction[1] = 2.0;
    assert_reach(0.25, 0.0);
    assert_reach(0.25, 1.5);
    assert_reach(0.5, 2.0);
    assert_reach(8.5, -10.0);
    plant.modes.joint[1] = RP_PLANT_BACKWARD;
    assert_reach(0.25, -0.5);
    plant.modes.joint[1] = RP_PLANT_STUCK;
    assert_reach(INFINITY, 0.0);
}

/* Where nothing of it is left, friction is constant over a step: no coefficient has any. */
static void test_friction_of_a_fast_joint_is_constant(void) {
    static row constant[MAX_ROWS];
    plant_test_start(&plant);
    plant.modes =
        (struct rp_plant_modes){{RP_PLANT_STUCK, RP_PLANT_FORWARD}, RP_PLANT_RELEASED, {0, 0}};
    plant.parameters.coulomb_friction[0] = 100.0;
    plant.parameters.coulomb_friction[1] = 1.0;
    plant.parameters.stribeck_velocity[1] = 0.25;
    plant.q[0] = 1.0;
    time_scale = 0.001;
    memset(inputs, 0, sizeof inputs);
    for (int n = 0; n < 2; n++) {
        plant.dq[1] = n == 0 ? 2.0 : 1.5; // 8 vs, 6 vs
        plant.parameters.breakaway_friction[1] = 1.0;
        expand(8, constant);
        plant.parameters.breakaway_friction[1] = 1000.0;
        expand(8, rows);
        const bool same = memcmp(constant[3], rows[3], 9 * sizeof(double)) == 0;
        TEST_ASSERT_TRUE(same == (n == 0));
    }
}
