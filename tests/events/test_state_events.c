/* State events. A ball that bounces: rest at v1 / g (1 + e) / (1 - e) from a height with
 * v1 = sqrt(2 g h). A block with dry friction: it stops after v m / F, and breaks away where the
 * force has reached the breakaway friction. Times of impacts: test_events.py of files with
 * equations; rollback: every FMU's, in test_every_fmu.py. */
#include "each_method.h"
#include "toy_run.h"

/* ---- Ball ----------------------------------------------------------------------------------- */

static const double g = 9.81;

EACH_METHOD static void test_it_comes_to_rest_on_the_floor(void) {
    static const double steps[] = {1e-3, 1.0, 10.0};
    for (int s = 0; s < 3; s++) {
        prepare(&ball_description, method, 1e-10);
        set(TOY_POSITION, 0.5);
        initialize();
        run(0.0, steps[s], (int)round(10.0 / steps[s]));
        TEST_ASSERT_EQUAL_DOUBLE(0.0, get(TOY_POSITION));
        TEST_ASSERT_EQUAL_DOUBLE(0.0, get(TOY_SPEED));
        TEST_ASSERT_EQUAL_DOUBLE(0.0, get(TOY_ACCELERATION));
        const double e = 0.8;
        const double rest = sqrt(2.0 * 0.5 / g) * (1.0 + e) / (1.0 - e);
        const double fraction = method == 1 || method == 2 ? 2e-3 : method == 3 ? 1e-2 : 1e-1;
        const double left_out = 2.0 * sqrt(2.0 * 1e-12 * fraction / g) / (1.0 - e);
        // with BDF the last bounces are as low as the error of the position
        const double most = method == 2 ? 1.5 : 1.0;
        const double early = rest - get(TOY_LAST_EVENT);
        TEST_ASSERT_TRUE(0.0 < early && early <= most * left_out);
    }
}

/* Bounces as low as the error of the position, in many internal steps each: they lose height,
 * however the steps lie to the floor. */
EACH_METHOD static void test_low_bounces_come_to_rest(void) {
    static const double longest_steps[] = {0.0, 1e-8, 1e-9, 1.7e-10};
    for (int s = 0; s < 4; s++) {
        prepare(&ball_description, method, 1e-10);
        set(TOY_POSITION, 1e-13);
        set(TOY_MAX_STEP, longest_steps[s]);
        initialize();
        run(0.0, 1e-6, 10);
        TEST_ASSERT_EQUAL_DOUBLE(0.0, get(TOY_ACCELERATION));
        TEST_ASSERT_INT_WITHIN(10, 10, get_int(TOY_EVENTS));
    }
}

/* Thrown down and lifted, it passes the floor by this depth between two communication points. */
EACH_METHOD static void test_a_short_dip_is_found(void) {
    static const double steps[] = {1e-3, 1e-2, 1.0, 4.0};
    for (int s = 0; s < 4; s++) {
        const double depth = 1e-7;
        const double pull = 1.0; // upwards
        const double v = -sqrt(2.0 * pull * (1.0 + depth));
        prepare(&ball_description, method, 1e-8);
        set(TOY_INPUT, g + pull);
        set(TOY_SPEED, v);
        initialize();
        run(0.0, steps[s], (int)round(4.0 / steps[s]));
        TEST_ASSERT_EQUAL_INT(1, get_int(TOY_EVENTS));
        // 2e-7 s for each 1e-10 m
        const double first = -v - sqrt(2.0 * pull * depth);
        TEST_ASSERT_DOUBLE_WITHIN(2e-7, first, get(TOY_LAST_EVENT));
    }
}

/* The internal steps of all flights count together. */
EACH_METHOD static void test_a_limit_of_internal_steps_ends_the_step(void) {
    prepare(&ball_description, method, 1e-8);
    set_int(TOY_MAX_STEPS, 30);
    initialize();
    TEST_ASSERT_EQUAL_INT(STATUS_TOO_MANY_STEPS, instance_do_step(instance, 0.0, 5.0, NULL));
    TEST_ASSERT_INT_WITHIN(2, 30, get_int(TOY_STEPS));
    TEST_ASSERT_GREATER_THAN_INT(0, get_int(TOY_EVENTS));
}

/* A step that leaves its event is followed by one that handles it. */
EACH_METHOD static void test_an_impact_that_was_left_comes_with_the_next_step(void) {
    const struct step_options left = {.at_event = EVENTS_LEFT};
    const double first = sqrt(2.0 / g);
    prepare(&ball_description, method, 1e-10);
    initialize();
    ASSERT_OK(instance_do_step(instance, 0.0, 1.0, &left));
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, first, instance_time(instance));
    TEST_ASSERT_EQUAL_INT(0, get_int(TOY_EVENTS));
    run(instance_time(instance), 0.1, 1);
    TEST_ASSERT_EQUAL_INT(1, get_int(TOY_EVENTS));
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, first, get(TOY_LAST_EVENT));
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, 0.8 * g * first - 0.1 * g, get(TOY_SPEED));
}

/* A lift that equals the weight and grows takes it from the floor without an event of its own. */
EACH_METHOD static void test_a_lift_that_grows_from_the_weight_on_takes_it_at_once(void) {
    for (int rises = 0; rises < 2; rises++) {
        prepare(&ball_description, method, 1e-10);
        set(TOY_POSITION, 0.0);
        initialize();
        run(0.0, 1.0, 1);
        set(TOY_INPUT, g);
        set_input_derivative(TOY_INPUT, 1, rises ? 1.0 : -1.0);
        run(1.0, 1.0, 1);
        TEST_ASSERT_EQUAL_INT(0, get_int(TOY_EVENTS));
        TEST_ASSERT_DOUBLE_WITHIN(1e-8, rises ? 1.0 / 6.0 : 0.0, get(TOY_POSITION));
    }
}

/* An integrator outside ends a little before the impact or a little after it. */
static void test_integrated_from_outside_it_bounces_once_where_it_falls(void) {
    static const struct {
        double h, v;
        bool bounces;
    } cases[] = {{-1e-3, -2.0, true}, {-1e-12, -2.0, true}, {0.0, -2.0, true}, {1e-12, -2.0, true},
                 {1e-3, -2.0, false}, {1e-12, 2.0, false},  {0.0, 2.0, false}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const bool bounces = cases[i].bounces;
        struct discrete_update update = {.states_changed = !bounces};
        double x[2] = {cases[i].h, cases[i].v};
        prepare_outside(&ball_description);
        ASSERT_OK(instance_set_time(instance, 0.4));
        ASSERT_OK(instance_set_states(instance, x, 2));
        instance_enter_event_mode(instance);
        for (int k = 0; k < 3; k++) {
            ASSERT_OK(instance_update_discrete_states(instance, &update));
            TEST_ASSERT_EQUAL_INT(bounces && k == 0, update.states_changed);
        }
        ASSERT_OK(instance_get_states(instance, x, 2));
        TEST_ASSERT_EQUAL_DOUBLE(bounces ? 0.0 : cases[i].h, x[0]);
        TEST_ASSERT_EQUAL_DOUBLE(bounces ? 1.6 : cases[i].v, x[1]);
        TEST_ASSERT_EQUAL_INT(bounces, get_int(TOY_EVENTS));
        TEST_ASSERT_EQUAL_DOUBLE(bounces ? 0.4 : 0.0, get(TOY_LAST_EVENT));
    }
}

static bool has_no_modes;

static enum status update_or_fail(void *values, const struct event *event) {
    return has_no_modes ? STATUS_NOT_FINITE : ball_description.model->events->update(values, event);
}

static void test_a_step_that_fails_at_once_leaves_the_time(void) {
    struct model_events events = *ball_description.model->events;
    struct model model = *ball_description.model;
    struct model_description failing = ball_description;
    events.update = update_or_fail;
    model.events = &events;
    failing.model = &model;
    create(&failing);
    setup(instance, 5.0, INFINITY);
    set(TOY_POSITION, 10.0);
    has_no_modes = false;
    initialize();
    for (int i = 0; i < 2; i++) { // nothing has been integrated yet; then there is a history
        const double time = 5.0 + i * 0.125;
        has_no_modes = true;
        set(TOY_INPUT, 1.0 + i);
        TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE, instance_do_step(instance, time, 0.125, NULL));
        TEST_ASSERT_EQUAL_DOUBLE(time, instance_time(instance));
        TEST_ASSERT_EQUAL_DOUBLE(time, get(TOY_TIME));
        has_no_modes = false;
        run(time, 0.125, 1);
    }
    tearDown();
}

static void test_a_ball_in_the_air_does_not_rest(void) {
    start_moving(&ball_description);
    struct ball_values *now = (void *)instance->memory.values;
    struct ball_values *held = (void *)instance->memory.restart_values;
    assert_forged(&now->is_resting, &held->is_resting, 2, "the modes are impossible");
    assert_forged(&now->is_resting, &held->is_resting, -1, "the modes are impossible");
    assert_forged(&now->is_resting, &held->is_resting, 1,
                  "the modes since the restart are impossible");
}

/* ---- Block ---------------------------------------------------------------------------------- */

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

EACH_METHOD static void test_a_ramp_breaks_it_away(void) {
    prepare(&block_description, method, 1e-10);
    initialize();
    set_input_derivative(TOY_INPUT, 1, 0.25);
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
    set_input_derivative(TOY_INPUT, 1, -0.5);
    run(0.0, 5.0, 1); // v = t - t^2 / 4 to the stop at t = 4
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get(TOY_SPEED));
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 4.0, get(TOY_LAST_EVENT));
    run(5.0, 1.0, 1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 1.0, get(TOY_SPEED));
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 8.0 / 3.0 + 0.5, get(TOY_POSITION));
}

/* The force touches the limit and falls again. */
EACH_METHOD static void test_a_touch_does_not_break_it_away(void) {
    prepare(&block_description, method, 1e-10);
    initialize();
    set_input_derivative(TOY_INPUT, 1, 1.0); // f = t - t^2 / 4, 1 at t = 2
    set_input_derivative(TOY_INPUT, 2, -0.5);
    run(0.0, 3.0, 1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.0, get(TOY_SPEED));
}

/* In Event Mode the importer takes back the force that would have broken it away. */
static void test_a_force_taken_back_in_event_mode_moves_nothing(void) {
    const struct step_options left = {.at_event = EVENTS_LEFT};
    struct discrete_update update;
    prepare(&block_description, 1, 1e-10);
    initialize();
    set_input_derivative(TOY_INPUT, 1, 0.25);
    ASSERT_OK(instance_do_step(instance, 0.0, 8.0, &left));
    set(TOY_INPUT, 0.5);
    ASSERT_OK(instance_update_discrete_states(instance, &update));
    run(instance_time(instance), 1.0, 1);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get(TOY_SPEED));
}

/* The same where the importer integrates: with the force set in Event Mode it sticks. A force
 * exactly equal to the breakaway friction triggers nothing. */
static void test_forces_from_outside_that_move_nothing(void) {
    static const double forces[][2] = {{2.0, 0.5}, {1.0, 1.0}, {-2.0, -0.5}, {-1.0, -1.0}};
    for (int i = 0; i < 4; i++) {
        struct discrete_update update;
        prepare_outside(&block_description);
        set(TOY_INPUT, forces[i][0]);
        instance_enter_event_mode(instance);
        const bool is_taken_back = forces[i][1] != forces[i][0];
        if (is_taken_back) {
            set(TOY_INPUT, forces[i][1]);
        }
        ASSERT_OK(instance_update_discrete_states(instance, &update));
        TEST_ASSERT_EQUAL_INT(0, ((const struct block_values *)instance->memory.values)->direction);
        TEST_ASSERT_TRUE(is_taken_back || (get_int(TOY_EVENTS) == 0 && !update.states_changed));
    }
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
