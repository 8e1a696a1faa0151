/* A block with dry friction: it stops after v m / F, and breaks away where the force has reached
 * the breakaway friction. */
#include "each_method.h"
#include "toy_run.h"

#include "continuous_states.h"
#include "derivatives.h"

EACH_METHOD static void test_it_stops_and_stays(void) {
    static const double steps[] = {1e-3, 1e-2, 1.0};
    for (int s = 0; s < 3; s++) {
        prepare(&block_description, method, 1e-10);
        set(TOY_SPEED, 1.5);
        initialize();
        run(0.0, steps[s], (int)round(3.0 / steps[s]));
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1.5, get(TOY_LAST_EVENT));
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1.125, get(TOY_POSITION));
        TEST_ASSERT_EQUAL_DOUBLE(0.0, get(TOY_SPEED));
        TEST_ASSERT_EQUAL_INT(1, get_int(TOY_EVENTS));
    }
}

static void set_slope(double slope) {
    const unsigned reference = TOY_INPUT;
    const int order = 1;
    ASSERT_OK(instance_set_input_derivatives(instance, &reference, 1, &order, &slope));
}

EACH_METHOD static void test_a_ramp_breaks_it_away(void) {
    prepare(&block_description, method, 1e-10);
    initialize();
    set_slope(0.25);
    run(0.0, 8.0, 1);
    TEST_ASSERT_EQUAL_INT(1, get_int(TOY_EVENTS));
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 4.0, get(TOY_LAST_EVENT));
    // v' = (t - 4) / 4
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 2.0, get(TOY_SPEED));
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 64.0 / 24.0, get(TOY_POSITION));
}

/* The slope ends with its step. Then the force is again the one that was set, here enough to move a
 * block which stopped while the force was small. */
EACH_METHOD static void test_it_breaks_away_where_a_slope_ends(void) {
    prepare(&block_description, method, 1e-10);
    initialize();
    set(TOY_INPUT, 2.0);
    set_slope(-0.5);
    run(0.0, 5.0, 1); // v = t - t^2 / 4 to the stop at t = 4
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get(TOY_SPEED));
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 4.0, get(TOY_LAST_EVENT));
    run(5.0, 1.0, 1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 1.0, get(TOY_SPEED));
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 8.0 / 3.0 + 0.5, get(TOY_POSITION));
}

/* The force touches the limit and falls again. */
EACH_METHOD static void test_a_touch_does_not_break_it_away(void) {
    const unsigned references[] = {TOY_INPUT, TOY_INPUT};
    const int orders[] = {1, 2};
    const double values[] = {1.0, -0.5}; // f = t - t^2 / 4, 1 at t = 2
    prepare(&block_description, method, 1e-10);
    initialize();
    ASSERT_OK(instance_set_input_derivatives(instance, references, 2, orders, values));
    run(0.0, 3.0, 1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.0, get(TOY_SPEED));
}

/* In Event Mode the importer takes back the force that would have broken it away. */
static void test_a_force_taken_back_in_event_mode_moves_nothing(void) {
    const struct step_options left = {.at_event = EVENTS_LEFT};
    struct discrete_update update;
    prepare(&block_description, 1, 1e-10);
    initialize();
    set_slope(0.25);
    ASSERT_OK(instance_do_step_with(instance, 0.0, 8.0, &left));
    set(TOY_INPUT, 0.5);
    ASSERT_OK(instance_update_discrete_states(instance, &update));
    run(instance_time(instance), 1.0, 1);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get(TOY_SPEED));
}

/* The same where the importer integrates: with the force set in Event Mode it sticks. */
static void test_a_force_taken_back_moves_nothing_outside(void) {
    struct discrete_update update;
    for (int sign = -1; sign <= 1; sign += 2) {
        prepare(&block_description, 1, 1e-10);
        instance_integrate_outside(instance);
        initialize();
        ASSERT_OK(instance_enter_continuous_time(instance));
        set(TOY_INPUT, sign * 2.0);
        instance_enter_event_mode(instance);
        set(TOY_INPUT, sign * 0.5);
        ASSERT_OK(instance_update_discrete_states(instance, &update));
        const struct block_values *block = (const void *)instance->memory.values;
        TEST_ASSERT_EQUAL_INT(0, block->direction);
    }
}

/* A force exactly equal to the breakaway friction holds: outside, too. */
static void test_a_force_equal_to_the_friction_triggers_nothing_outside(void) {
    struct discrete_update update;
    for (int sign = -1; sign <= 1; sign += 2) {
        prepare(&block_description, 1, 1e-10);
        instance_integrate_outside(instance);
        initialize();
        ASSERT_OK(instance_enter_continuous_time(instance));
        set(TOY_INPUT, sign * 1.0);
        instance_enter_event_mode(instance);
        ASSERT_OK(instance_update_discrete_states(instance, &update));
        TEST_ASSERT_EQUAL_INT(0, get_int(TOY_EVENTS));
        TEST_ASSERT_FALSE(update.states_changed);
    }
}

/* Inputs within the friction's limits: nothing moves, nothing is integrated. */
EACH_METHOD static void test_it_holds_against_changing_forces(void) {
    prepare(&block_description, method, 1e-10);
    set(TOY_POSITION, 0.1);
    initialize();
    for (int i = 0; i < 10000; i++) {
        set(TOY_INPUT, 0.999 * sin(0.01 * i));
        run(i * 1e-3, 1e-3, 1);
    }
    TEST_ASSERT_EQUAL_DOUBLE(0.1, get(TOY_POSITION));
    TEST_ASSERT_EQUAL_INT(0, get_int(TOY_STEPS));
    TEST_ASSERT_EQUAL_INT(0, get_int(TOY_RESTARTS));
}

/* One that is pushed back and forth sticks at each turn if the force lags. */
EACH_METHOD static void test_rollback_over_events(void) {
    struct instance_snapshot *snapshot = NULL;
    double straight[2];
    for (int with_rollback = 0; with_rollback < 2; with_rollback++) {
        prepare(&block_description, method, 1e-8);
        initialize();
        for (int i = 0; i < 400; i++) {
            set(TOY_INPUT, 2.5 * sin(0.3 * (i / 3)));
            if (with_rollback && i % 5 == 0) {
                ASSERT_OK(instance_save(instance, 0, &snapshot));
                run(i * 0.01, 0.01, 3);
                ASSERT_OK(instance_restore(instance, snapshot));
                ASSERT_OK(instance_forget(instance, &snapshot));
            }
            run(i * 0.01, 0.01, 1);
        }
        TEST_ASSERT_GREATER_THAN_INT(3, get_int(TOY_EVENTS));
        if (!with_rollback) {
            straight[0] = get(TOY_POSITION);
            straight[1] = get(TOY_LAST_EVENT);
        }
    }
    TEST_ASSERT_EQUAL_DOUBLE(straight[0], get(TOY_POSITION));
    TEST_ASSERT_EQUAL_DOUBLE(straight[1], get(TOY_LAST_EVENT));
}

static void test_a_block_slides_where_its_velocity_points(void) {
    start_moving(&block_description);
    struct block_values *now = (void *)instance->memory.values;
    struct block_values *held = (void *)instance->memory.restart_values;
    assert_forged(&now->direction, &held->direction, 2, "the modes are impossible");
    assert_forged(&now->direction, &held->direction, -2, "the modes are impossible");
    assert_forged(&now->direction, &held->direction, -1,
                  "the modes since the restart are impossible");
    assert_forged(&now->direction, &held->direction, 0,
                  "the modes since the restart are impossible");
}
