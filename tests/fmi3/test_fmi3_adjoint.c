/* Adjoint derivatives: which ones there are. That they are the transposed directional derivatives:
 * test_knowns.py. FMI 3.0, section 2.2.11. */
#include "fmu3_harness.h"

#include <unity.h>

/* Of parameters, too, before the first step; a known that is listed twice is answered twice. */
static void test_parameters_and_repeated_knowns(void) {
    const fmi3ValueReference unknown = RP_MANIPULATOR_potential_energy;
    const fmi3ValueReference of[] = {RP_MANIPULATOR_g, RP_MANIPULATOR_q1, RP_MANIPULATOR_g};
    const double seed = 2.0;
    const double one = 1.0;
    double adjoint[3];
    double directional;
    const fmi3Instance instance = fmu3_co_simulation(NULL);
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
    for (size_t k = 0; k < 2 * FMU_COUNT(wrong); k++) {
        const bool is_unknown = k % 2 == 1;
        fmi3ValueReference rows[] = {RP_MANIPULATOR_ddq1, RP_MANIPULATOR_ddq2};
        fmi3ValueReference columns[] = {RP_MANIPULATOR_q1, RP_MANIPULATOR_q2};
        *(is_unknown ? &rows[1] : &columns[1]) = wrong[k / 2][is_unknown];
        const double seed[] = {1.0, 1.0};
        double result[] = {-1.0, -1.0};
        const fmi3Instance instance = fmu3_co_simulation(NULL);
        fmu3_initialize(instance, 0.0);
        ASSERT_ERROR(fmu3.GetAdjointDerivative(instance, rows, 2, columns, 2, seed, 2, result, 2));
        TEST_ASSERT_TRUE(result[0] == -1.0 && result[1] == -1.0);
        fmu3_free(instance);
    }
    const fmi3ValueReference ddq1 = RP_MANIPULATOR_ddq1;
    const fmi3ValueReference dq1 = RP_MANIPULATOR_dq1;
    const fmi3Instance instance = fmu3_co_simulation(NULL);
    fmu3_set(instance, RP_MANIPULATOR_dq1, 1e160);
    fmu3_initialize(instance, 0.0);
    const double seed = 1e200;
    double result = -1.0;
    ASSERT_DISCARD(fmu3.GetAdjointDerivative(instance, &ddq1, 1, &dq1, 1, &seed, 1, &result, 1));
    TEST_ASSERT_TRUE(result == -1.0);
}
