/* State events of a block with dry friction: it stops after v m / F, and breaks away where the
 * force has reached the breakaway friction. */
#include "each_method.h"
#include "event_run.h"

EACH_METHOD static void test_it_stops_and_stays(void) {
    static const double steps[] = {1e-3, 1e-2, 1.0};
    for (int s = 0; s < 3; s++) {
        prepare(method, 1e-10);
        set(BLOCK_v, 1.5);
        initialize();
        run(0.0, steps[s], (int)round(3.0 / steps[s]));
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1.5, last_event_time());
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1.125, get(BLOCK_x));
        TEST_ASSERT_EQUAL_DOUBLE(0.0, get(BLOCK_v));
        TEST_ASSERT_EQUAL_INT(1, event_count());
    }
}

EACH_METHOD static void test_a_ramp_breaks_it_away(void) {
    prepare(method, 1e-10);
    initialize();
    set_input_derivative(BLOCK_f, 1, 0.25);
    run(0.0, 8.0, 1);
    TEST_ASSERT_EQUAL_INT(1, event_count());
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 4.0, last_event_time());
    // v' = (t - 4) / 4
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 2.0, get(BLOCK_v));
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 64.0 / 24.0, get(BLOCK_x));
}

/* The slope ends with its step. Then the force is again the one that was set, here enough to move a
 * block which stopped while the force was small. */
EACH_METHOD static void test_it_breaks_away_where_a_slope_ends(void) {
    prepare(method, 1e-10);
    initialize();
    set(BLOCK_f, 2.0);
    set_input_derivative(BLOCK_f, 1, -0.5);
    run(0.0, 5.0, 1); // v = t - t^2 / 4 to the stop at t = 4
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get(BLOCK_v));
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 4.0, last_event_time());
    run(5.0, 1.0, 1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 1.0, get(BLOCK_v));
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 8.0 / 3.0 + 0.5, get(BLOCK_x));
}

/* The force touches the limit and falls again. */
EACH_METHOD static void test_a_touch_does_not_break_it_away(void) {
    prepare(method, 1e-10);
    initialize();
    set_input_derivative(BLOCK_f, 1, 1.0); // f = t - t^2 / 4, 1 at t = 2
    set_input_derivative(BLOCK_f, 2, -0.5);
    run(0.0, 3.0, 1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.0, get(BLOCK_v));
}

/* In Event Mode the importer takes back the force that would have broken it away. */
static void test_a_force_taken_back_in_event_mode_moves_nothing(void) {
    const struct step_options left = {.at_event = EVENTS_LEFT};
    struct discrete_update update;
    prepare(1, 1e-10);
    initialize();
    set_input_derivative(BLOCK_f, 1, 0.25);
    ASSERT_OK(instance_do_step(instance, 0.0, 8.0, &left));
    set(BLOCK_f, 0.5);
    ASSERT_OK(instance_update_discrete_states(instance, &update));
    run(instance_time(instance), 1.0, 1);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get(BLOCK_v));
}

/* The same where the importer integrates: with the force set in Event Mode it sticks. A force
 * exactly equal to the breakaway friction triggers nothing. */
static void test_forces_from_outside_that_move_nothing(void) {
    static const double forces[][2] = {{2.0, 0.5}, {1.0, 1.0}, {-2.0, -0.5}, {-1.0, -1.0}};
    for (int i = 0; i < 4; i++) {
        struct discrete_update update;
        prepare(1, 1e-8);
        begin_outside();
        set(BLOCK_f, forces[i][0]);
        instance_enter_event_mode(instance);
        const bool is_taken_back = forces[i][1] != forces[i][0];
        if (is_taken_back) {
            set(BLOCK_f, forces[i][1]);
        }
        ASSERT_OK(instance_update_discrete_states(instance, &update));
        TEST_ASSERT_EQUAL_INT(0, get_int(BLOCK_direction));
        TEST_ASSERT_TRUE(is_taken_back || (event_count() == 0 && !update.states_changed));
    }
}

static void test_modes_that_do_not_exist_are_refused(void) {
    prepare(1, 1e-8);
    set(BLOCK_v, 2.0);
    initialize();
    run(0.0, 1e-3, 2);
    struct equations_values *now = (void *)instance->memory.values;
    struct equations_values *held = (void *)instance->memory.restart_values;
    assert_forged(&now->m_direction, &held->m_direction, 2, "direction = 2 is impossible");
    assert_forged(now->relations, held->relations, 2, "the modes are impossible");
    assert_forged(now->active, held->active, -1, "the modes are impossible");
}
