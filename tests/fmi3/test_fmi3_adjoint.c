/* Adjoint derivatives: the transposed directional derivatives. FMI 3.0, section 2.2.11. */
#include "fmu3_harness.h"

#include <math.h>
#include <stdint.h>
#include <unity.h>

static const fmi3ValueReference unknowns[] = {
    RP_MANIPULATOR_ddq1,
    RP_MANIPULATOR_ddq2,
    RP_MANIPULATOR_dq1,
    RP_MANIPULATOR_ee_x,
    RP_MANIPULATOR_ee_vy,
    RP_MANIPULATOR_total_energy,
    RP_MANIPULATOR_actuator_power,
    RP_MANIPULATOR_D11,
    RP_MANIPULATOR_f1_x,
    RP_MANIPULATOR_q1,
};
static const fmi3ValueReference knowns[] = {
    RP_MANIPULATOR_q1,  RP_MANIPULATOR_q2,   RP_MANIPULATOR_dq1,
    RP_MANIPULATOR_dq2, RP_MANIPULATOR_tau1, RP_MANIPULATOR_f2,
};
enum { UNKNOWNS = 10, KNOWNS = 6 };

/* splitmix64: Steele, Lea and Flood, Fast splittable pseudorandom number generators, 2014. */
static double random_between(double low, double high) {
    static uint64_t state = 1;
    uint64_t z = state += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return low + (high - low) * ((double)((z ^ (z >> 31)) >> 11) * 0x1p-53);
}

static void go_to_random_point(fmi3Instance instance) {
    for (int i = 0; i < KNOWNS; i++) {
        fmu3_set(instance, knowns[i], random_between(-3.0, 3.0));
    }
    fmu3_set(instance, RP_MANIPULATOR_m2, random_between(0.2, 3.0));
    fmu3_set(instance, RP_MANIPULATOR_g, random_between(0.0, 12.0));
}

/* Column by column. */
static void get_jacobian(fmi3Instance instance, double J[UNKNOWNS][KNOWNS]) {
    for (int j = 0; j < KNOWNS; j++) {
        const double one = 1.0;
        double column[UNKNOWNS];
        ASSERT_OK(fmu3.GetDirectionalDerivative(instance, unknowns, UNKNOWNS, &knowns[j], 1, &one,
                                                1, column, UNKNOWNS));
        for (int i = 0; i < UNKNOWNS; i++) {
            J[i][j] = column[i];
        }
    }
}

static void test_it_is_the_transposed_directional_derivative_at_1000_points(void) {
    const fmi3Instance instance = fmu3_co_simulation(&importer, NULL);
    ASSERT_OK(fmu3.EnterInitializationMode(instance, false, 0.0, 0.0, false, 0.0));
    for (int point = 0; point < 1000; point++) {
        double J[UNKNOWNS][KNOWNS];
        double seed[UNKNOWNS];
        double adjoint[KNOWNS];
        go_to_random_point(instance);
        get_jacobian(instance, J);
        for (int i = 0; i < UNKNOWNS; i++) {
            seed[i] = random_between(-1.0, 1.0);
        }
        ASSERT_OK(fmu3.GetAdjointDerivative(instance, unknowns, UNKNOWNS, knowns, KNOWNS, seed,
                                            UNKNOWNS, adjoint, KNOWNS));
        for (int j = 0; j < KNOWNS; j++) {
            long double expected = 0.0L;
            double scale = 0.0;
            for (int i = 0; i < UNKNOWNS; i++) {
                expected += (long double)seed[i] * J[i][j];
                scale += fabs(seed[i] * J[i][j]);
            }
            TEST_ASSERT_DOUBLE_WITHIN(1e-14 * scale, (double)expected, adjoint[j]);
        }
    }
}

/* Of parameters, too, before the first step; a known that is listed twice is answered twice. */
static void test_parameters_and_repeated_knowns(void) {
    const fmi3ValueReference unknown = RP_MANIPULATOR_potential_energy;
    const fmi3ValueReference of[] = {RP_MANIPULATOR_g, RP_MANIPULATOR_q1, RP_MANIPULATOR_g};
    const double seed = 2.0;
    const double one = 1.0;
    double adjoint[3];
    double directional;
    const fmi3Instance instance = fmu3_co_simulation(&importer, NULL);
    fmu3_set(instance, RP_MANIPULATOR_q1, 0.7);
    ASSERT_OK(fmu3.EnterInitializationMode(instance, false, 0.0, 0.0, false, 0.0));
    ASSERT_OK(fmu3.GetAdjointDerivative(instance, &unknown, 1, of, 3, &seed, 1, adjoint, 3));
    ASSERT_OK(
        fmu3.GetDirectionalDerivative(instance, &unknown, 1, of, 1, &one, 1, &directional, 1));
    TEST_ASSERT_TRUE(directional != 0.0);
    TEST_ASSERT_TRUE(adjoint[0] == seed * directional);
    TEST_ASSERT_TRUE(adjoint[2] == adjoint[0]);
    // also later
    ASSERT_OK(fmu3.ExitInitializationMode(instance));
    double later[3];
    ASSERT_OK(fmu3.GetAdjointDerivative(instance, &unknown, 1, of, 3, &seed, 1, later, 3));
    TEST_ASSERT_EQUAL_MEMORY(adjoint, later, sizeof later);
}

/* Nothing is written where one of them is refused. */
static void test_what_is_refused(void) {
    static const fmi3ValueReference wrong[][2] = {
        // as a known, as an unknown
        {RP_MANIPULATOR_ee_x, RP_MANIPULATOR_time},
        {RP_MANIPULATOR_ddq1, RP_MANIPULATOR_m1},
        {RP_MANIPULATOR_relative_tolerance, RP_MANIPULATOR_tau1},
        {RP_MANIPULATOR_solver_steps, RP_MANIPULATOR_solver_steps},
        {9999, 9999},
    };
    for (size_t k = 0; k < 2 * FMU3_COUNT(wrong); k++) {
        const bool is_unknown = k % 2 == 1;
        fmi3ValueReference rows[] = {RP_MANIPULATOR_ddq1, RP_MANIPULATOR_ddq2};
        fmi3ValueReference columns[] = {RP_MANIPULATOR_q1, RP_MANIPULATOR_q2};
        *(is_unknown ? &rows[1] : &columns[1]) = wrong[k / 2][is_unknown];
        const double seed[] = {1.0, 1.0};
        double result[] = {-1.0, -1.0};
        const fmi3Instance instance = fmu3_co_simulation(&importer, NULL);
        fmu3_initialize(instance, 0.0);
        ASSERT_ERROR(fmu3.GetAdjointDerivative(instance, rows, 2, columns, 2, seed, 2, result, 2));
        TEST_ASSERT_TRUE(result[0] == -1.0 && result[1] == -1.0);
        fmu3_free(instance);
    }
    const fmi3Instance instance = fmu3_co_simulation(&importer, NULL);
    fmu3_set(instance, RP_MANIPULATOR_dq1, 1e160);
    fmu3_initialize(instance, 0.0);
    const double seed = 1e200;
    double result = -1.0;
    ASSERT_DISCARD(
        fmu3.GetAdjointDerivative(instance, &unknowns[0], 1, &knowns[2], 1, &seed, 1, &result, 1));
    TEST_ASSERT_TRUE(result == -1.0);
}
