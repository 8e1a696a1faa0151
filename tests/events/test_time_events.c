/* Time events: a hammer strikes a mass at given times, with each method. The motion between two
 * strokes follows a constant force. */
#include "each_method.h"
#include "event_run.h"

#include <stdlib.h>

static const double period = 0.3, first = 0.07, kick = 0.25, force = 0.5;

static int strokes(void) {
    return (int)get(HAMMER_strokes);
}

static void start_as(const struct model_description *description, int with_method,
                     double start_time, double between, double offset) {
    prepare_as(description, start_time, with_method, 1e-10);
    set(HAMMER_period, between);
    set(HAMMER_first, offset);
    set(HAMMER_kick, kick);
    set(HAMMER_f, force);
    initialize();
}

static void start_hammer(int with_method, double start_time, double between, double offset) {
    start_as(&model_description, with_method, start_time, between, offset);
}

/* The hammer with functions of its events that no file has; it outlives the tests. */
static struct model_description altered;
static struct model altered_model;
static struct model_events altered_events;

static void alter(void) {
    altered = model_description;
    altered_model = equations_model;
    altered_events = *equations_model.events;
    altered_model.events = &altered_events;
    altered.model = &altered_model;
}

/* The motion from x = 1 m at rest, t s after the start. */
static void expected_motion(double t, double x[2]) {
    x[0] = 1.0 + 0.5 * force * t * t;
    x[1] = force * t;
    for (int n = 0; first + n * period <= t; n++) {
        x[0] += kick * (t - first - n * period);
        x[1] += kick;
    }
}

EACH_METHOD static void test_the_motion_between_strokes(void) {
    static const double steps[] = {0.001, 0.007, 0.25, 5.0};
    for (int i = 0; i < 4; i++) {
        const double h = steps[i];
        const int count = (int)(5.0 / h);
        double x[2];
        start_hammer(method, 2.0, period, first);
        run(2.0, h, count);
        expected_motion(count * h, x);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, x[0], get(HAMMER_x));
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, x[1], get(HAMMER_v));
        const int expected = 1 + (int)((count * h - first) / period);
        TEST_ASSERT_EQUAL_INT(expected, strokes());
        TEST_ASSERT_EQUAL_INT(expected, event_count());
        TEST_ASSERT_EQUAL_DOUBLE(2.0 + first + (expected - 1) * period, last_event_time());
    }
}

/* A force that changes along a line is read where the stroke is. */
static void test_inputs_are_those_of_the_time(void) {
    static const double steps[] = {0.01, 0.05, 0.125};
    for (int i = 0; i < 3; i++) {
        const double h = steps[i];
        start_hammer(1, 0.0, period, first);
        for (int k = 0; k < (int)(1.0 / h); k++) {
            const double slope = 2.0;
            set(HAMMER_f, slope * k * h);
            set_input_derivative(HAMMER_f, 1, slope);
            ASSERT_OK(instance_do_step(instance, k * h, h, NULL));
            if (strokes() > 0) {
                const double stroke = first + (strokes() - 1) * period;
                TEST_ASSERT_DOUBLE_WITHIN(1e-15, slope * stroke, get(HAMMER_last));
            }
        }
        TEST_ASSERT_EQUAL_INT(4, strokes());
    }
}

/* A stroke behind a communication point belongs to the next step, however late it is: here by a
 * thousandth of a step at 1e5 s, in steps of two lengths. */
static void test_a_stroke_behind_a_point_waits_for_the_next_step(void) {
    static const double steps[] = {0x1p-10, 0x1p-12};
    for (int i = 0; i < 2; i++) {
        const double h = steps[i];
        start_hammer(1, 1e5, 1.0, 0x1p-3 + 0x1p-20);
        run(1e5, h, (int)(0x1p-3 / h));
        TEST_ASSERT_EQUAL_INT(0, strokes());
        run(1e5 + 0x1p-3, h, 1);
        TEST_ASSERT_EQUAL_INT(1, strokes());
        TEST_ASSERT_EQUAL_DOUBLE(1e5 + 0x1p-3 + 0x1p-20, last_event_time());
    }
}

/* Where times are exact, none is early. */
static void test_strokes_close_to_each_other(void) {
    start_hammer(1, 1.0, 0x1p-38, 0.25);
    run(1.0, 0.25, 1);
    TEST_ASSERT_EQUAL_INT(1, strokes());
    TEST_ASSERT_TRUE(get(HAMMER_time) == 1.25);
    ASSERT_OK(instance_do_step(instance, 1.25, 0x1p-22, NULL));
    TEST_ASSERT_EQUAL_INT(1 + (1 << 16), strokes());
    TEST_ASSERT_TRUE(last_event_time() == 1.25 + 0x1p-22);
}

/* v = -1 m/s from x = 1 m: the wall is hit after the stroke or before it. */
EACH_METHOD static void test_state_events_beside_time_events(void) {
    static const double offsets[] = {0.5, 2.0};
    static const double hit_at[] = {0.5 + 0.5 / 0.75, 1.0};
    for (int i = 0; i < 2; i++) {
        prepare(method, 1e-10);
        set(HAMMER_period, 100.0);
        set(HAMMER_first, offsets[i]);
        set(HAMMER_kick, kick);
        set_int(HAMMER_max_events, 1); // of state events
        set(HAMMER_v, -1.0);
        initialize();
        run(0.0, 3.0, 1);
        TEST_ASSERT_EQUAL_DOUBLE(1.0, get(HAMMER_hits));
        TEST_ASSERT_EQUAL_INT(1, strokes());
        const double speed = i == 0 ? 0.75 : 1.0;
        const double struck = i == 0 ? 0.0 : kick * (3.0 - offsets[i]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, speed * (3.0 - hit_at[i]) + struck, get(HAMMER_x));
    }
}

/* Rounding decides which of two comes first; neither is lost. */
EACH_METHOD static void test_a_stroke_at_the_wall(void) {
    prepare(method, 1e-10);
    set(HAMMER_period, 100.0);
    set(HAMMER_kick, kick);
    set(HAMMER_v, -1.0);
    initialize();
    run(0.0, 3.0, 1);
    TEST_ASSERT_EQUAL_DOUBLE(1.0, get(HAMMER_hits));
    TEST_ASSERT_EQUAL_INT(1, strokes());
    const bool is_struck_first = get(HAMMER_v) < 1.0;
    const double speed = is_struck_first ? 1.0 - kick : 1.0 + kick;
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 2.0 * speed, get(HAMMER_x));
}

/* The limit is for events that could follow each other without end. */
static void test_a_step_may_have_more_time_events_than_max_events(void) {
    start_hammer(1, 0.0, 1e-3, 1e-3);
    run(0.0, 5.0005, 1);
    TEST_ASSERT_EQUAL_INT(5000, strokes());
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 5000 * kick + force * 5.0005, get(HAMMER_v));
}

/* Strokes closer to each other than those of a sampler may be. */
static double gap; /* s */

static double next_close_time(const void *values) {
    return 0.25 + ((const struct equations_values *)values)->v_strokes * gap;
}

static enum status strike_only(void *values, const struct event *event) {
    if (!event->is_timed) {
        return equations_model.events->update(values, event);
    }
    ((struct equations_values *)values)->v_strokes += 1.0;
    return STATUS_OK;
}

static void prepare_close_strokes(double between) {
    gap = between;
    alter();
    altered_events.next_time = next_close_time;
    altered_events.update = strike_only;
    prepare_as(&altered, 0.0, 1, 1e-8);
}

/* Strokes at the end of a step, closer than roundings, need no internal step; they are limited all
 * the same. */
static void test_the_internal_steps_allowed_limit_time_events(void) {
    prepare_close_strokes(0x1p-54);
    set_int(HAMMER_max_internal_steps, 3);
    initialize();
    TEST_ASSERT_EQUAL_INT(STATUS_TOO_MANY_EVENTS, instance_do_step(instance, 0.0, 0.25, NULL));
    TEST_ASSERT_EQUAL_STRING("the step ended at t = 0.25: a time event is due there, one more than "
                             "max_internal_steps = 3",
                             last_text);
    TEST_ASSERT_EQUAL_INT(3, strokes());
    TEST_ASSERT_EQUAL_INT(3, event_count());
    TEST_ASSERT_EQUAL_INT(STATUS_TOO_MANY_STEPS, instance_do_step(instance, 0.25, 0x1p-40, NULL));
    TEST_ASSERT_GREATER_THAN_INT(3, strokes());
}

static void test_time_events_without_progress_are_refused(void) {
    prepare_close_strokes(0.0);
    initialize();
    last_text[0] = '\0';
    TEST_ASSERT_EQUAL_INT(STATUS_INTERNAL, instance_do_step(instance, 0.0, 1.0, NULL));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(last_text, "at t = 0.25 is followed by one"), last_text);
}

/* A step that ends at the stroke, with the stroke still due. */
static void test_a_stroke_is_left_to_event_mode(void) {
    const struct step_options left = {.at_event = EVENTS_LEFT};
    struct discrete_update update;
    start_hammer(1, 0.0, period, first);
    ASSERT_OK(instance_do_step(instance, 0.0, 1.0, &left));
    TEST_ASSERT_TRUE(instance_met_event(instance) && instance_time(instance) == first);
    TEST_ASSERT_EQUAL_INT(0, strokes());
    ASSERT_OK(instance_update_discrete_states(instance, &update));
    TEST_ASSERT_EQUAL_INT(1, strokes());
    TEST_ASSERT_EQUAL_DOUBLE(first + period, update.next_time);
    ASSERT_OK(instance_do_step(instance, first, 0.1, &left));
    TEST_ASSERT_FALSE(instance_met_event(instance));
    ASSERT_OK(instance_do_step(instance, first + 0.1, 0.2, &left)); // with rounding: at the end
    TEST_ASSERT_TRUE(instance_met_event(instance));
    ASSERT_OK(instance_do_step(instance, first + 0.1 + 0.2, 0.1, &left)); // passes it first
    TEST_ASSERT_EQUAL_INT(2, strokes());
}

static bool is_held_until_struck(const void *values) {
    return ((const struct equations_values *)values)->v_strokes == 0.0;
}

/* A mass that is held until the first stroke moves the same whether or not a step ends there. */
EACH_METHOD static void test_a_stroke_ends_rest(void) {
    const struct step_options left = {.at_event = EVENTS_LEFT};
    double straight[3];
    alter();
    altered_events.is_at_rest = is_held_until_struck;
    for (int i = 0; i < 2; i++) {
        start_as(&altered, method, 0.0, 5.0, first);
        if (i == 1) {
            ASSERT_OK(instance_do_step(instance, 0.0, 1.0, &left));
            TEST_ASSERT_EQUAL_DOUBLE(first, instance_time(instance));
            TEST_ASSERT_EQUAL_DOUBLE(0.0, get(HAMMER_v));
        }
        ASSERT_OK(instance_do_step(instance, instance_time(instance), 1.0 - instance_time(instance),
                                   NULL));
        const double x[] = {get(HAMMER_x), get(HAMMER_v), get_int(HAMMER_solver_steps)};
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, kick + force * (1.0 - first), x[1]);
        if (i == 0) {
            memcpy(straight, x, sizeof straight);
        }
        TEST_ASSERT_EQUAL_MEMORY(straight, x, sizeof straight);
    }
}

/* An integrator outside goes to the time that it was given. */
static enum status rising_force(void *context, double time) {
    set(HAMMER_f, 2.0 * time);
    return STATUS_OK;
}

/* Where a step ends at a stroke, an input that it asked for keeps the value that it has there, not
 * the one that was given for the end. */
static void test_an_input_stays_where_the_stroke_is(void) {
    static const enum event_handling handlings[] = {EVENTS_END, EVENTS_LEFT};
    for (int i = 0; i < 2; i++) {
        const struct step_options options = {.ask_inputs = rising_force, .at_event = handlings[i]};
        start_hammer(1, 0.0, period, first);
        ASSERT_OK(instance_do_step(instance, 0.0, 0.2, &options));
        TEST_ASSERT_EQUAL_DOUBLE(first, instance_time(instance));
        ASSERT_OK(instance_do_step(instance, first, 0.1, NULL));
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, first * first + kick + 2.0 * first * 0.1, get(HAMMER_v));
    }
}

static void test_integrated_from_outside(void) {
    struct discrete_update update;
    prepare_as(&model_description, 1.0, 1, 1e-8);
    set(HAMMER_first, first);
    instance_integrate_outside(instance);
    initialize();
    ASSERT_OK(instance_update_discrete_states(instance, &update));
    TEST_ASSERT_FALSE(update.states_changed);
    for (int n = 1; n <= 3; n++) {
        const double t = 1.0 + first + (n - 1) * 1.0;
        TEST_ASSERT_EQUAL_DOUBLE(t, update.next_time);
        ASSERT_OK(instance_enter_continuous_time(instance));
        ASSERT_OK(instance_set_time(instance, t - 0.01));
        instance_enter_event_mode(instance);
        ASSERT_OK(instance_update_discrete_states(instance, &update));
        TEST_ASSERT_EQUAL_INT(n - 1, strokes());
        ASSERT_OK(instance_enter_continuous_time(instance));
        ASSERT_OK(instance_set_time(instance, t));
        instance_enter_event_mode(instance);
        for (int k = 0; k < 2; k++) {
            ASSERT_OK(instance_update_discrete_states(instance, &update));
            TEST_ASSERT_EQUAL_INT(k == 0, update.states_changed);
            TEST_ASSERT_EQUAL_INT(n, strokes());
            TEST_ASSERT_EQUAL_INT(n, event_count());
        }
    }
}

/* One that passes several strokes gets one with each update. */
static void test_strokes_passed_from_outside_follow_one_by_one(void) {
    struct discrete_update update;
    prepare(1, 1e-8);
    set(HAMMER_first, first);
    instance_integrate_outside(instance);
    initialize();
    ASSERT_OK(instance_enter_continuous_time(instance));
    ASSERT_OK(instance_set_time(instance, first + 2.5));
    instance_enter_event_mode(instance);
    for (int n = 1; n <= 4; n++) {
        ASSERT_OK(instance_update_discrete_states(instance, &update));
        TEST_ASSERT_EQUAL_INT(n < 4, update.states_changed);
        TEST_ASSERT_EQUAL_DOUBLE(first + (n < 3 ? n : 3), update.next_time);
        TEST_ASSERT_EQUAL_INT(n < 3, update.is_incomplete);
    }
    TEST_ASSERT_EQUAL_INT(3, strokes());
}

static void test_a_declaration_that_does_not_fit_the_model_is_refused(void) {
    struct instance *none = NULL;
    alter();
    altered.has_time_events = false;
    TEST_ASSERT_EQUAL_INT(STATUS_INTERNAL, instance_create(&altered, &last_text_sink, &none));
    alter();
    altered_events.next_time = NULL;
    TEST_ASSERT_EQUAL_INT(STATUS_INTERNAL, instance_create(&altered, &last_text_sink, &none));
    TEST_ASSERT_NULL(none);
}

/* What update writes is 0 until it is called. */
static void test_no_stroke_before_the_start(void) {
    prepare(1, 1e-8);
    struct equations_values *now = (void *)instance->memory.values;
    ASSERT_OK(pass_on());
    now->start = 1.0;
    ASSERT_REFUSED(pass_on());
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(last_text, "the modes are impossible"), last_text);
}
