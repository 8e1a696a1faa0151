/* Events and their indicators in Model Exchange, through either version of FMI. */
#include "fmu_version.h"
#include "value_references.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

static struct fmu_functions fmu;
static fmi2Component c;
static char last_message[512];

static void keep(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                 fmi2String category, fmi2String message, ...) {
    snprintf(last_message, sizeof last_message, "%s", message);
}

#define ASSERT_OK(call) TEST_ASSERT_EQUAL_INT_MESSAGE(fmi2OK, call, last_message)

static void instantiate(fmi2Type type) {
    static const fmi2CallbackFunctions callbacks = {
        .logger = keep, .allocateMemory = calloc, .freeMemory = free};
    c = fmu.Instantiate("wheel", type, WHEEL_GUID, NULL, &callbacks, fmi2False, fmi2False);
    TEST_ASSERT_NOT_NULL_MESSAGE(c, last_message);
    ASSERT_OK(fmu.SetupExperiment(c, fmi2False, 0, 0, fmi2False, 0));
    ASSERT_OK(fmu.EnterInitializationMode(c));
}

void setUp(void) {
    last_message[0] = '\0';
    if (fmu.Instantiate == NULL && fmu_version_open(&fmu) == NULL) {
        exit(2);
    }
}

void tearDown(void) {
    fmu.FreeInstance(c);
    c = NULL;
}

static void set_real(fmi2ValueReference reference, double value) {
    ASSERT_OK(fmu.SetReal(c, &reference, 1, &value));
}

static fmi2Integer get_integer(fmi2ValueReference reference) {
    fmi2Integer value = -1;
    ASSERT_OK(fmu.GetInteger(c, &reference, 1, &value));
    return value;
}

static double to_stop(void) {
    double z[2] = {-1.0, -1.0};
    ASSERT_OK(fmu.GetEventIndicators(c, z, 2));
    return z[0];
}

/* Event mode at this angle: whether the state has jumped. */
static bool update_at(double angle) {
    fmi2EventInfo info;
    ASSERT_OK(fmu.SetContinuousStates(c, &angle, 1));
    ASSERT_OK(fmu.EnterEventMode(c));
    memset(&info, 0xff, sizeof info);
    ASSERT_OK(fmu.NewDiscreteStates(c, &info));
    TEST_ASSERT_FALSE(info.newDiscreteStatesNeeded || info.terminateSimulation ||
                      info.nominalsOfContinuousStatesChanged || info.nextEventTimeDefined);
    ASSERT_OK(fmu.EnterContinuousTimeMode(c));
    return info.valuesOfContinuousStatesChanged;
}

static void start_model_exchange(double stop, double speed) {
    fmi2EventInfo info;
    instantiate(fmi2ModelExchange);
    set_real(WHEEL_stop, stop);
    set_real(WHEEL_speed, speed);
    ASSERT_OK(fmu.ExitInitializationMode(c));
    ASSERT_OK(fmu.NewDiscreteStates(c, &info));
    ASSERT_OK(fmu.EnterContinuousTimeMode(c));
}

/* The stop catches the wheel once, whether the importer enters event mode near it or past it.
 * Entering too early changes nothing. */
static void test_an_event_in_model_exchange(void) {
    static const double angles[] = {2.0 - 1e-12, 2.0, 2.0 + 1e-12, 2.5};
    for (size_t i = 0; i < sizeof angles / sizeof angles[0]; i++) {
        start_model_exchange(2.0, 1.0);
        TEST_ASSERT_FALSE(update_at(1.9));
        TEST_ASSERT_FALSE(update_at(2.0 - 1e-9));
        TEST_ASSERT_EQUAL_INT(0, get_integer(WHEEL_catches));
        TEST_ASSERT_TRUE(update_at(angles[i]) == (angles[i] != 2.0));
        TEST_ASSERT_EQUAL_INT(1, get_integer(WHEEL_catches));
        TEST_ASSERT_FALSE(update_at(2.0));
        TEST_ASSERT_EQUAL_INT(1, get_integer(WHEEL_catches));
        TEST_ASSERT_TRUE(to_stop() == 1.0); // no longer used
        fmu.FreeInstance(c);
    }
    c = NULL;
}

/* At its root the indicator is still above 0, so that an event can begin a mode there. */
static void test_an_indicator_falls_to_0_just_past_its_root(void) {
    static const double angles[] = {2.0, 2.0 + 1e-11};
    start_model_exchange(2.0, 1.0);
    for (int i = 0; i < 2; i++) {
        ASSERT_OK(fmu.SetContinuousStates(c, &angles[i], 1));
        TEST_ASSERT_TRUE(i == 0 ? to_stop() > 0.0 : to_stop() < 0.0);
    }
}
