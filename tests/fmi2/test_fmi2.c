/* Instances of the FMU: what Instantiate refuses, and free and reset. Many instances at once:
 * robustness/threads.c. FMI 2.0, sections 2.1.5 and 2.1.6. */
#include "fmu_harness.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

/* ---- Instantiate ---------------------------------------------------------------------------- */

static void test_instantiate_says_what_it_refuses(void) {
    fmu_only_in(2, "FMI 3.0 has other arguments: test_fmi3.c");
    static const char guid[] = RP_MANIPULATOR_GUID;
    static const struct {
        const char *name;
        fmi2Type type;
        const char *guid;
        const char *wrong, *expected; /* words of the message */
    } cases[] = {
        {NULL, fmi2CoSimulation, guid, "name", "not empty"},
        {"", fmi2CoSimulation, guid, "name", "not empty"},
        {"m", (fmi2Type)7, guid, "type", "7"},
        {"m", (fmi2Type)-1, guid, "type", "-1"},
        {"m", fmi2CoSimulation, NULL, "GUID", guid},
        {"m", fmi2CoSimulation, "", "GUID", guid},
        {"m", fmi2CoSimulation, "{another}", "{another}", guid},
        {"m", fmi2CoSimulation, "{%s%n#}", "GUID", guid},
        {"m", fmi2ModelExchange, "{another}", "{another}", guid},
    };
    for (size_t i = 0; i < FMU_COUNT(cases); i++) {
        fmu_log_clear(&messages);
        const fmi2CallbackFunctions callbacks = fmu_callbacks(&messages);
        TEST_ASSERT_NULL(fmu.Instantiate(cases[i].name, cases[i].type, cases[i].guid, NULL,
                                         &callbacks, fmi2False, fmi2False));
        TEST_ASSERT_EQUAL_UINT(1, fmu_log_total(&messages));
        TEST_ASSERT_EQUAL_UINT(1, fmu_log_count(&messages, "logStatusError"));
        fmu_assert_logged(&messages, cases[i].wrong);
        fmu_assert_logged(&messages, cases[i].expected);
    }
}

static void test_instantiate_without_functions_gives_no_instance(void) {
    fmu_only_in(2, "FMI 3.0 has no structure of callbacks");
    TEST_ASSERT_NULL(fmu.Instantiate("m", fmi2CoSimulation, RP_MANIPULATOR_GUID, NULL, NULL,
                                     fmi2False, fmi2True));
    TEST_ASSERT_NULL(fmu.Instantiate(NULL, fmi2ModelExchange, NULL, NULL, NULL, 0, 0));
}

static void test_instantiate_without_logger_gives_no_crash(void) {
    const fmi2CallbackFunctions none = {0};
    TEST_ASSERT_NULL(fmu.Instantiate("", fmi2CoSimulation, RP_MANIPULATOR_GUID, "", &none, 0, 0));
    TEST_ASSERT_NULL(fmu.Instantiate("m", fmi2CoSimulation, "wrong", "", &none, 0, 0));

    const fmi2Component c =
        fmu.Instantiate("m", fmi2CoSimulation, RP_MANIPULATOR_GUID, NULL, &none, 0, fmi2True);
    TEST_ASSERT_NOT_NULL(c);
    ASSERT_OK(fmu.SetDebugLogging(c, fmi2True, 0, NULL));
    ASSERT_DISCARD(fmu_try_set(c, RP_MANIPULATOR_tau1, NAN));
    ASSERT_ERROR(fmu_try_set(c, RP_MANIPULATOR_ddq1, 1.0));
    fmu_assert_reset_is_fresh(c, "without callbacks");
    fmu.FreeInstance(c);
}

/* The memory functions are optional: canNotUseMemoryManagementFunctions is declared. */
static void test_the_other_callbacks_may_be_null(void) {
    fmi2CallbackFunctions callbacks = fmu_callbacks(&messages);
    callbacks.allocateMemory = NULL;
    callbacks.freeMemory = NULL;
    callbacks.stepFinished = NULL;
    const char *const locations[] = {NULL, "", "file:///nowhere/resources"};
    for (size_t i = 0; i < FMU_COUNT(locations); i++) {
        const fmi2Component c = fmu.Instantiate("m", fmi2CoSimulation, RP_MANIPULATOR_GUID,
                                                locations[i], &callbacks, fmi2False, fmi2False);
        TEST_ASSERT_NOT_NULL(c);
        fmu_assert_reset_is_fresh(c, "without memory functions");
        fmu.FreeInstance(c);
    }
}

static char *copied(const char *text) {
    const size_t size = strlen(text) + 1;
    char *copy = malloc(size);
    TEST_ASSERT_NOT_NULL(copy);
    return memcpy(copy, text, size);
}

static void test_nothing_passed_to_instantiate_is_kept(void) {
    char *name = copied("short-lived");
    char *guid = copied(RP_MANIPULATOR_GUID);
    fmi2CallbackFunctions *callbacks = malloc(sizeof *callbacks);
    TEST_ASSERT_NOT_NULL(callbacks);
    *callbacks = fmu_callbacks(&messages);
    const fmi2Component c =
        fmu.Instantiate(name, fmi2CoSimulation, guid, name, callbacks, fmi2False, fmi2False);
    memset(name, 'x', strlen(name));
    memset(guid, 'x', strlen(guid));
    memset(callbacks, 0x55, sizeof *callbacks);
    free(name);
    free(guid);
    free(callbacks);

    TEST_ASSERT_NOT_NULL(c);
    ASSERT_ERROR(fmu_try_set(c, RP_MANIPULATOR_ddq1, 1.0));
    TEST_ASSERT_EQUAL_STRING("short-lived", messages.instance_name);
    fmu_assert_reset_is_fresh(c, "after the arguments of Instantiate are gone");
    fmu.FreeInstance(c);
}

/* ---- Free and Reset ------------------------------------------------------------------------- */

static void test_free_of_nothing_does_nothing(void) {
    fmu.FreeInstance(NULL);

    const fmi2Component c = fmu_initialized(&messages, 0.0);
    fmi2FMUstate none = NULL;
    ASSERT_OK(fmu.FreeFMUstate(c, NULL));
    ASSERT_OK(fmu.FreeFMUstate(c, &none));
    TEST_ASSERT_NULL(none);
    ASSERT_OK(fmu.DoStep(c, 0.0, 0.1, fmi2True));
    TEST_ASSERT_EQUAL_UINT(0, fmu_log_total(&messages));
}

static void test_reset_brings_back_start_values_and_no_experiment(void) {
    const fmi2Component c = fmu_instantiate(&messages, false);
    fmu_set(c, RP_MANIPULATOR_relative_tolerance, 1e-3);
    fmu_set(c, RP_MANIPULATOR_q2, 0.7);
    fmu_set(c, RP_MANIPULATOR_tau1, 7.0);
    ASSERT_OK(fmu.SetupExperiment(c, fmi2True, 1e-4, 3.0, fmi2True, 4.0));
    ASSERT_OK(fmu.EnterInitializationMode(c));
    ASSERT_OK(fmu.ExitInitializationMode(c));
    ASSERT_OK(fmu.DoStep(c, 3.0, 0.5, fmi2True));
    fmu_assert_reset_is_fresh(c, "after a run with everything set");

    if (fmu_version == 2) { // in FMI 3.0 the experiment comes with this call
        ASSERT_OK(fmu.Reset(c));
        ASSERT_ERROR(fmu.EnterInitializationMode(c));
        fmu_assert_logged(&messages, "experiment");
        fmu_assert_in_error(c);
        fmu_assert_reset_is_fresh(c, "after an initialization without experiment");
    }
}
