/* Steps of the core that end at an event, and how the next one continues from there. */
#include "wheel_instance.h"

#include "continuous_states.h"
#include "stepping.h"

static const double start_time = 1e6; /* s; communication points are 1e-10 s apart */

/* Initialized at start_time; the stop is reached 0.04 s later. */
static void start(void) {
    const struct instance_experiment experiment = {.start_time = start_time};
    instance_reset(instance);
    ASSERT_OK(instance_setup_experiment(instance, &experiment));
    ASSERT_OK(instance_enter_initialization(instance));
    set(WHEEL_stop, 2.0);
    set(WHEEL_angle, 1.96);
    set(WHEEL_speed, 1.0);
    ASSERT_OK(instance_exit_initialization(instance));
}

static void step_to(double end, enum event_handling at_event) {
    const struct step_options options = {.at_event = at_event};
    const double now = instance_time(instance);
    ASSERT_OK(instance_do_step_with(instance, now, end - now, &options));
}

static void step(enum event_handling at_event) {
    const struct step_options options = {.at_event = at_event};
    ASSERT_OK(instance_do_step_with(instance, start_time, 0.1, &options));
}

static void update(void) {
    struct discrete_update update;
    ASSERT_OK(instance_update_discrete_states(instance, &update));
}

/* Importers' times are rounded; the instance's own continues as if the step had not ended. */
static void test_the_end_of_a_step_cut_short_is_kept(void) {
    static const enum event_handling ways[] = {EVENTS_END, EVENTS_LEFT};
    start();
    step(EVENTS_PASSED);
    const struct clock_time expected = instance->state.time;
    TEST_ASSERT_TRUE(expected.rest != 0.0);
    for (size_t i = 0; i < 2; i++) {
        start();
        step(ways[i]);
        TEST_ASSERT_TRUE(instance_met_event(instance));
        TEST_ASSERT_EQUAL_INT(ways[i] == EVENTS_END, values_of(instance)->is_caught);
        step_to(expected.s, ways[i]);
        TEST_ASSERT_FALSE(instance_met_event(instance));
        TEST_ASSERT_EQUAL_INT(1, values_of(instance)->is_caught);
        TEST_ASSERT_TRUE(instance->state.time.s == expected.s);
        TEST_ASSERT_TRUE(instance->state.time.rest == expected.rest);
    }
}

static void test_another_end_is_taken_as_it_is(void) {
    start();
    step(EVENTS_END);
    step_to(start_time + 0.1 + 1e-9, EVENTS_END);
    TEST_ASSERT_TRUE(instance->state.time.s == start_time + 0.1 + 1e-9);
    TEST_ASSERT_TRUE(instance->state.time.rest == 0.0);
}

/* The step after an event continues from it, unless something has changed there. */
static void test_a_change_at_the_event_is_noticed(void) {
    for (int changes = 0; changes < 2; changes++) {
        start();
        step(EVENTS_LEFT);
        TEST_ASSERT_EQUAL_INT(EVENT_UNHANDLED, instance->state.event_point);
        set(WHEEL_speed, changes ? 1.5 : 1.0);
        update();
        TEST_ASSERT_EQUAL_INT(changes ? NO_EVENT : EVENT_HANDLED, instance->state.event_point);
    }
}

/* Between events modes change where something is set, and only there. */
static void test_event_mode_without_a_change_changes_nothing(void) {
    start();
    step_to(start_time + 0.01, EVENTS_LEFT);
    values_of(instance)->angle = 2.0; // as rounding could have it
    update();
    TEST_ASSERT_EQUAL_INT(0, values_of(instance)->is_caught);
    set(WHEEL_speed, 1.5);
    update();
    TEST_ASSERT_EQUAL_INT(1, values_of(instance)->is_caught);
}
