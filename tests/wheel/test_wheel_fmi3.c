/* What only FMI 3.0 has: event mode and early return, that is what a step does at the event where
 * the stop catches the wheel, for each of the four ways in which importers instantiate. */
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

#define ASSERT_OK(call) TEST_ASSERT_EQUAL_INT_MESSAGE(fmi3OK, call, last_message)

static void set_speed(double value) {
    const fmi3ValueReference reference = WHEEL_speed;
    ASSERT_OK(fmu3.SetFloat64(wheel, &reference, 1, &value, 1));
}

static double get_real(fmi3ValueReference reference) {
    double value = -1.0;
    ASSERT_OK(fmu3.GetFloat64(wheel, &reference, 1, &value, 1));
    return value;
}

static void update(void) {
    bool needs_update = true, terminate = true, nominals = true, states = true, next = true;
    double time;
    ASSERT_OK(fmu3.UpdateDiscreteStates(wheel, &needs_update, &terminate, &nominals, &states, &next,
                                        &time));
    TEST_ASSERT_FALSE(needs_update || terminate || nominals || states || next);
}

static fmi3Instance instantiate(bool event_mode, bool early_return) {
    fmi3Instance created =
        fmu3.InstantiateCoSimulation("wheel", WHEEL_TOKEN_FMI3, NULL, false, false, event_mode,
                                     early_return, NULL, 0, NULL, keep, NULL);
    TEST_ASSERT_NOT_NULL_MESSAGE(created, last_message);
    return created;
}

/* At t = 0, with a stop at 2 rad and a speed of 1 rad/s: it catches the wheel at t = 2 s. */
static void start(bool event_mode, bool early_return) {
    const fmi3ValueReference stop = WHEEL_stop;
    const double angle = 2.0;
    wheel = instantiate(event_mode, early_return);
    ASSERT_OK(fmu3.EnterInitializationMode(wheel, false, 0.0, 0.0, false, 0.0));
    ASSERT_OK(fmu3.SetFloat64(wheel, &stop, 1, &angle, 1));
    set_speed(1.0);
    ASSERT_OK(fmu3.ExitInitializationMode(wheel));
    if (event_mode) {
        update();
        ASSERT_OK(fmu3.EnterStepMode(wheel));
    }
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

/* ---- Steps ---------------------------------------------------------------------------------- */

struct outcome {
    bool needs_event_mode;
    bool terminates;
    bool is_early;
    double reached; /* s */
};

static struct outcome step(double time, double h) {
    struct outcome outcome = {true, true, true, -1.0};
    ASSERT_OK(fmu3.DoStep(wheel, time, h, true, &outcome.needs_event_mode, &outcome.terminates,
                          &outcome.is_early, &outcome.reached));
    TEST_ASSERT_FALSE(outcome.terminates);
    return outcome;
}

static void assert_outcome(struct outcome outcome, bool needs_event_mode, bool is_early) {
    TEST_ASSERT_EQUAL_INT(needs_event_mode, outcome.needs_event_mode);
    TEST_ASSERT_EQUAL_INT(is_early, outcome.is_early);
}

static void assert_caught(bool expected) {
    const fmi3ValueReference caught = WHEEL_is_caught;
    const fmi3ValueReference catches = WHEEL_catches;
    bool is_caught = !expected;
    fmi3Int32 count = -1;
    ASSERT_OK(fmu3.GetBoolean(wheel, &caught, 1, &is_caught, 1));
    ASSERT_OK(fmu3.GetInt32(wheel, &catches, 1, &count, 1));
    TEST_ASSERT_EQUAL_INT(expected, is_caught);
    TEST_ASSERT_EQUAL_INT(expected, count);
    TEST_ASSERT_TRUE(get_real(WHEEL_lost_speed) == (expected ? 1.0 : 0.0));
    TEST_ASSERT_TRUE(get_real(WHEEL_rate) == (expected ? 0.0 : 1.0));
}

static void assert_at(double time, double angle) {
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, time, get_real(WHEEL_time));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, angle, get_real(WHEEL_angle));
}

/* Without event mode the event is handled in the step; without early return the step goes on to its
 * end. With both it ends at the event's left limit, and event mode shows both limits. */
static void test_a_step_over_the_event(void) {
    static const struct {
        bool event_mode, early_return;
        double end;
        bool is_caught; /* at the end of the step */
    } ways[] = {{false, false, 6.0, true},
                {false, true, 2.0, true},
                {true, false, 6.0, true},
                {true, true, 2.0, false}};
    for (size_t i = 0; i < sizeof ways / sizeof ways[0]; i++) {
        start(ways[i].event_mode, ways[i].early_return);
        assert_outcome(step(0.0, 1.0), false, false);
        const struct outcome outcome = step(1.0, 5.0);
        assert_outcome(outcome, ways[i].event_mode, ways[i].early_return);
        TEST_ASSERT_TRUE(outcome.reached == get_real(WHEEL_time));
        assert_caught(ways[i].is_caught);
        assert_at(ways[i].end, 2.0);
        if (ways[i].event_mode) {
            ASSERT_OK(fmu3.EnterEventMode(wheel));
            assert_caught(ways[i].is_caught);
            for (int k = 0; k < 2; k++) {
                update();
                assert_caught(true);
            }
            TEST_ASSERT_TRUE(get_real(WHEEL_angle) == 2.0 && get_real(WHEEL_to_stop) == 1.0);
            ASSERT_OK(fmu3.EnterStepMode(wheel));
        }
        assert_outcome(step(outcome.reached, 7.0 - outcome.reached), false, false);
        assert_caught(true);
        assert_at(7.0, 2.0);
        release();
    }
}

/* Up to the left limit of the event. */
static double step_to_event(void) {
    start(true, true);
    assert_outcome(step(0.0, 1.0), false, false);
    const struct outcome outcome = step(1.0, 5.0);
    assert_outcome(outcome, true, true);
    TEST_ASSERT_TRUE(outcome.reached == get_real(WHEEL_time));
    assert_caught(false);
    assert_at(2.0, 2.0);
    return outcome.reached;
}

static void test_the_next_step_passes_an_event_that_is_due(void) {
    const double time = step_to_event();
    assert_outcome(step(time, 4.0), false, false);
    assert_caught(true);
    assert_at(time + 4.0, 2.0);
}

/* An event at the end of a step is no early return, and it is left all the same. */
static void test_an_event_at_the_end_of_a_step(void) {
    start(true, true);
    assert_outcome(step(0.0, 2.0), true, false);
    assert_caught(false);
    ASSERT_OK(fmu3.EnterEventMode(wheel));
    update();
    assert_caught(true);
}

/* Inputs that jump in event mode count together with the event. */
static void test_inputs_that_jump_at_the_event(void) {
    const fmi3ValueReference counting = WHEEL_is_counting;
    const bool off = false;
    const double time = step_to_event();
    ASSERT_OK(fmu3.EnterEventMode(wheel));
    set_speed(-1.0);
    ASSERT_OK(fmu3.SetBoolean(wheel, &counting, 1, &off, 1));
    update();
    TEST_ASSERT_TRUE(get_real(WHEEL_rate) == -1.0 && get_real(WHEEL_lost_speed) == 0.0);
    ASSERT_OK(fmu3.EnterStepMode(wheel));
    assert_outcome(step(time, 1.0), false, false);
    assert_at(time + 1.0, 1.0);
}

/* No step returns where it began: such an event is passed at once. */
static void test_an_event_at_the_beginning_of_a_step(void) {
    const fmi3ValueReference stop = WHEEL_stop;
    const double angle = 1e-12; // reached 1e-12 s after 1e6 s, which is the same number
    wheel = instantiate(true, true);
    ASSERT_OK(fmu3.EnterInitializationMode(wheel, false, 0.0, 1e6, false, 0.0));
    ASSERT_OK(fmu3.SetFloat64(wheel, &stop, 1, &angle, 1));
    set_speed(1.0);
    ASSERT_OK(fmu3.ExitInitializationMode(wheel));
    update();
    ASSERT_OK(fmu3.EnterStepMode(wheel));
    const struct outcome outcome = step(1e6, 1.0);
    assert_outcome(outcome, true, false);
    TEST_ASSERT_TRUE(outcome.reached == 1e6 + 1.0);
    assert_caught(true);
}
