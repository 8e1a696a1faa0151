/* Booleans, Integers that the model calculates and event indicators through FMI 3.0. */
#include "fmu3_library.h"
#include "value_references.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

static struct fmu3_functions fmu3;
static fmi3Instance wheel;
static char last_message[512];

static void keep(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                 fmi3String message) {
    snprintf(last_message, sizeof last_message, "%s", message);
}

static void initialize_mode(void) {
    TEST_ASSERT_NOT_NULL_MESSAGE(wheel, last_message);
    TEST_ASSERT_EQUAL_INT(fmi3OK, fmu3.EnterInitializationMode(wheel, false, 0.0, 0.0, false, 0.0));
}

static void co_simulation(void) {
    static const fmi3String categories[] = {"logStatusDiscard", "logStatusError"};
    wheel = fmu3.InstantiateCoSimulation("wheel", WHEEL_TOKEN_FMI3, NULL, false, false, false,
                                         false, NULL, 0, NULL, keep, NULL);
    initialize_mode();
    TEST_ASSERT_EQUAL_INT(fmi3OK, fmu3.SetDebugLogging(wheel, true, 2, categories));
}

static void model_exchange(void) {
    wheel =
        fmu3.InstantiateModelExchange("wheel", WHEEL_TOKEN_FMI3, NULL, false, false, NULL, keep);
    initialize_mode();
}

void setUp(void) {
    last_message[0] = '\0';
    if (fmu3.GetVersion == NULL && fmu3_library_open(WHEEL_LIBRARY, &fmu3) == NULL) {
        exit(2);
    }
}

static void release(void) {
    fmu3.FreeInstance(wheel);
    wheel = NULL;
}

void tearDown(void) {
    release();
}

static void assert_message(const char *text) {
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(last_message, text), last_message);
}

static fmi3Status set_boolean(fmi3ValueReference reference, bool value) {
    return fmu3.SetBoolean(wheel, &reference, 1, &value, 1);
}

static void set_real(fmi3ValueReference reference, double value) {
    TEST_ASSERT_EQUAL_INT(fmi3OK, fmu3.SetFloat64(wheel, &reference, 1, &value, 1));
}

static bool get_boolean(fmi3ValueReference reference) {
    bool values[2] = {true, false};
    const fmi3ValueReference twice[2] = {reference, reference};
    TEST_ASSERT_EQUAL_INT(fmi3OK, fmu3.GetBoolean(wheel, twice, 2, values, 2));
    TEST_ASSERT_TRUE(values[0] == values[1]);
    return values[0];
}

static fmi3Int32 turns(void) {
    const fmi3ValueReference reference = WHEEL_turns;
    fmi3Int32 value = -1;
    TEST_ASSERT_EQUAL_INT(fmi3OK, fmu3.GetInt32(wheel, &reference, 1, &value, 1));
    return value;
}

static void step(double time) {
    bool event, terminate, early;
    double reached = -1.0;
    TEST_ASSERT_EQUAL_INT(
        fmi3OK, fmu3.DoStep(wheel, time, 1.0, true, &event, &terminate, &early, &reached));
    TEST_ASSERT_EQUAL_DOUBLE(time + 1.0, reached);
}

/* At 7 rad/s the wheel has made n whole turns of 2 pi after n seconds, for n < 8. */
static void test_an_integer_counts_while_a_boolean_input_says_so(void) {
    co_simulation();
    set_real(WHEEL_speed, 7.0);
    TEST_ASSERT_EQUAL_INT(fmi3OK, fmu3.ExitInitializationMode(wheel));
    TEST_ASSERT_TRUE(get_boolean(WHEEL_is_turning));
    for (int n = 1; n < 8; n++) {
        step(n - 1);
        TEST_ASSERT_EQUAL_INT(fmi3OK, set_boolean(WHEEL_is_counting, true));
        TEST_ASSERT_EQUAL_INT(n, turns());
        TEST_ASSERT_EQUAL_INT(fmi3OK, set_boolean(WHEEL_is_counting, false));
        TEST_ASSERT_FALSE(get_boolean(WHEEL_is_counting));
        TEST_ASSERT_EQUAL_INT(0, turns());
    }
}

/* Memory that holds no bool, as a wrong importer may pass. */
static void test_a_byte_that_is_no_boolean_is_discarded(void) {
    const fmi3ValueReference reference = WHEEL_is_counting;
    const unsigned char byte = 2;
    co_simulation();
    TEST_ASSERT_EQUAL_INT(
        fmi3Discard, fmu3.SetBoolean(wheel, &reference, 1, (const bool *)(const void *)&byte, 1));
    assert_message("is_counting = 2 is refused: a value from 0 to 1 is expected");
    TEST_ASSERT_TRUE(get_boolean(WHEEL_is_counting));
}

static void test_other_types_and_counts_are_refused(void) {
    static const struct {
        fmi3ValueReference reference;
        const char *text;
    } cases[] = {
        {WHEEL_speed, "speed (value reference 20) is accessed as boolean: it is of type float64"},
        {WHEEL_turns, "accessed as boolean: it is of type int32"},
        {99, "value reference 99 is unknown"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        bool value = true;
        co_simulation();
        TEST_ASSERT_EQUAL_INT(fmi3Error, fmu3.GetBoolean(wheel, &cases[i].reference, 1, &value, 1));
        TEST_ASSERT_TRUE(value);
        assert_message(cases[i].text);
        release();
        co_simulation();
        TEST_ASSERT_EQUAL_INT(fmi3Error, set_boolean(cases[i].reference, true));
        assert_message(cases[i].text);
        release();
    }
    const fmi3ValueReference reference = WHEEL_is_counting;
    bool values[2] = {false, false};
    co_simulation();
    TEST_ASSERT_EQUAL_INT(fmi3Error, fmu3.GetBoolean(wheel, &reference, 1, values, 2));
    assert_message("an array has 2 values: 1 are expected");
}

/* In Model Exchange, a discrete input can be set in event mode only. */
static void test_model_exchange(void) {
    double z[2] = {-1.0, -1.0};
    const double x = 20.0;
    size_t count = 0;
    model_exchange();
    set_real(WHEEL_stop, 30.0);
    TEST_ASSERT_EQUAL_INT(fmi3OK, fmu3.ExitInitializationMode(wheel));
    TEST_ASSERT_EQUAL_INT(fmi3OK, fmu3.GetNumberOfEventIndicators(wheel, &count));
    TEST_ASSERT_EQUAL_size_t(2, count);
    TEST_ASSERT_EQUAL_INT(fmi3OK, fmu3.EnterContinuousTimeMode(wheel));
    TEST_ASSERT_EQUAL_INT(fmi3OK, fmu3.SetContinuousStates(wheel, &x, 1));
    TEST_ASSERT_EQUAL_INT(fmi3OK, fmu3.GetEventIndicators(wheel, z, 2));
    TEST_ASSERT_TRUE(z[0] > 10.0 && z[0] < 10.0 + 1e-11 && z[1] == 1.0);
    TEST_ASSERT_EQUAL_INT(3, turns());
    TEST_ASSERT_EQUAL_INT(fmi3OK, fmu3.EnterEventMode(wheel));
    TEST_ASSERT_EQUAL_INT(fmi3OK, set_boolean(WHEEL_is_counting, false));
    TEST_ASSERT_EQUAL_INT(0, turns());
    TEST_ASSERT_EQUAL_INT(fmi3OK, fmu3.EnterContinuousTimeMode(wheel));
    TEST_ASSERT_EQUAL_INT(fmi3Error, set_boolean(WHEEL_is_counting, true));
    assert_message("is_counting (value reference 21) cannot be set while the time is continuous");
}

/* Discrete variables are not those of intermediate updates. */
static void test_no_intermediate_update_of_booleans(void) {
    const fmi3ValueReference required = WHEEL_is_counting;
    TEST_ASSERT_NULL(fmu3.InstantiateCoSimulation("wheel", WHEEL_TOKEN_FMI3, NULL, false, false,
                                                  false, false, &required, 1, NULL, keep, NULL));
    assert_message("21");
}

static void test_only_reals_have_derivatives(void) {
    const fmi3ValueReference counting = WHEEL_is_counting;
    const fmi3ValueReference rate = WHEEL_rate;
    const fmi3ValueReference caught = WHEEL_is_caught;
    const double seed = 1.0;
    double result = 7.0;
    co_simulation();
    TEST_ASSERT_EQUAL_INT(fmi3Error, fmu3.GetDirectionalDerivative(wheel, &rate, 1, &counting, 1,
                                                                   &seed, 1, &result, 1));
    assert_message("is_counting (value reference 21) is refused: it is of type boolean");
    release();
    co_simulation();
    TEST_ASSERT_EQUAL_INT(fmi3Error, fmu3.GetAdjointDerivative(wheel, &caught, 1, &counting, 1,
                                                               &seed, 1, &result, 1));
    assert_message("is_caught (value reference 40) is refused: it is of type boolean");
    TEST_ASSERT_EQUAL_DOUBLE(7.0, result);
}
