/* State events of a bead that bounces: rest at v1 / g (1 + e) / (1 - e) from a height with
 * v1 = sqrt(2 g h). Times of impacts: test_events.py of files with equations; rollback: every
 * FMU's, in test_every_fmu.py. */
#include "each_method.h"
#include "event_run.h"

static const double g = 9.81;
static const double e = 0.8; // part of the speed that an impact leaves

/* It rests where a bounce is below the tolerance. */
static void set_bouncing(void) {
    set(BEAD_restitution, e);
    set(BEAD_slow, 0.0);
}

static void prepare_bouncing(int with_method, double tolerance) {
    prepare(with_method, tolerance);
    set_bouncing();
}

EACH_METHOD static void test_it_comes_to_rest_on_the_floor(void) {
    static const double steps[] = {1e-3, 1.0, 10.0};
    for (int s = 0; s < 3; s++) {
        prepare_bouncing(method, 1e-10);
        set(BEAD_x, 0.5);
        initialize();
        run(0.0, steps[s], (int)round(10.0 / steps[s]));
        TEST_ASSERT_EQUAL_DOUBLE(0.0, get(BEAD_x));
        TEST_ASSERT_EQUAL_DOUBLE(0.0, get(BEAD_v));
        TEST_ASSERT_EQUAL_DOUBLE(0.0, get(BEAD_a));
        const double rest = sqrt(2.0 * 0.5 / g) * (1.0 + e) / (1.0 - e);
        const double fraction = method == 1 || method == 2 ? 2e-3 : method == 3 ? 1e-2 : 1e-1;
        const double left_out = 2.0 * sqrt(2.0 * 1e-12 * fraction / g) / (1.0 - e);
        // with BDF the last bounces are as low as the error of the position
        const double most = method == 2 ? 1.5 : 1.0;
        const double early = rest - last_event_time();
        TEST_ASSERT_TRUE(0.0 < early && early <= most * left_out);
    }
}

/* Bounces as low as the error of the position, in many internal steps each: they lose height,
 * however the steps lie to the floor. */
EACH_METHOD static void test_low_bounces_come_to_rest(void) {
    static const double longest_steps[] = {0.0, 1e-8, 1e-9, 1.7e-10};
    for (int s = 0; s < 4; s++) {
        prepare_bouncing(method, 1e-10);
        set(BEAD_x, 1e-13);
        set(BEAD_max_step, longest_steps[s]);
        initialize();
        run(0.0, 1e-6, 10);
        TEST_ASSERT_EQUAL_DOUBLE(0.0, get(BEAD_a));
        TEST_ASSERT_INT_WITHIN(10, 10, event_count());
    }
}

/* Thrown down and lifted, it passes the floor by this depth between two communication points. */
EACH_METHOD static void test_a_short_dip_is_found(void) {
    static const double steps[] = {1e-3, 1e-2, 1.0, 4.0};
    for (int s = 0; s < 4; s++) {
        const double depth = 1e-7;
        const double pull = 1.0; // upwards
        const double v = -sqrt(2.0 * pull * (1.0 + depth));
        prepare_bouncing(method, 1e-8);
        set(BEAD_lift, g + pull);
        set(BEAD_v, v);
        initialize();
        run(0.0, steps[s], (int)round(4.0 / steps[s]));
        TEST_ASSERT_EQUAL_INT(1, event_count());
        // 2e-7 s for each 1e-10 m
        const double first = -v - sqrt(2.0 * pull * depth);
        TEST_ASSERT_DOUBLE_WITHIN(2e-7, first, last_event_time());
    }
}

/* The internal steps of all flights count together. */
EACH_METHOD static void test_a_limit_of_internal_steps_ends_the_step(void) {
    prepare_bouncing(method, 1e-8);
    set_int(BEAD_max_internal_steps, 30);
    initialize();
    TEST_ASSERT_EQUAL_INT(STATUS_TOO_MANY_STEPS, instance_do_step(instance, 0.0, 5.0, NULL));
    TEST_ASSERT_INT_WITHIN(2, 30, get_int(BEAD_solver_steps));
    TEST_ASSERT_GREATER_THAN_INT(0, event_count());
}

/* A step that leaves its event is followed by one that handles it. */
EACH_METHOD static void test_an_impact_that_was_left_comes_with_the_next_step(void) {
    const struct step_options left = {.at_event = EVENTS_LEFT};
    const double first = sqrt(2.0 / g);
    prepare_bouncing(method, 1e-10);
    initialize();
    ASSERT_OK(instance_do_step(instance, 0.0, 1.0, &left));
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, first, instance_time(instance));
    TEST_ASSERT_EQUAL_INT(0, event_count());
    run(instance_time(instance), 0.1, 1);
    TEST_ASSERT_EQUAL_INT(1, event_count());
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, first, last_event_time());
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, e * g * first - 0.1 * g, get(BEAD_v));
}

/* A lift that equals the weight and grows takes it from the floor without an event of its own. */
EACH_METHOD static void test_a_lift_that_grows_from_the_weight_on_takes_it_at_once(void) {
    for (int rises = 0; rises < 2; rises++) {
        prepare_bouncing(method, 1e-10);
        set(BEAD_x, 0.0);
        initialize();
        run(0.0, 1.0, 1);
        set(BEAD_lift, g);
        set_input_derivative(BEAD_lift, 1, rises ? 1.0 : -1.0);
        run(1.0, 1.0, 1);
        TEST_ASSERT_EQUAL_INT(0, event_count());
        TEST_ASSERT_DOUBLE_WITHIN(1e-8, rises ? 1.0 / 6.0 : 0.0, get(BEAD_x));
    }
}

EACH_METHOD static void test_a_ramp_lifts_it_from_rest(void) {
    prepare_bouncing(method, 1e-10);
    set(BEAD_x, 0.0);
    initialize();
    set_input_derivative(BEAD_lift, 1, 0.25 * g);
    run(0.0, 6.0, 1);
    TEST_ASSERT_EQUAL_INT(1, event_count());
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 4.0, last_event_time());
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 0.5 * g, get(BEAD_v)); // v' = g (t - 4) / 4
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, g / 3.0, get(BEAD_x));
}

/* The lift touches the weight and falls again. */
EACH_METHOD static void test_a_touch_does_not_lift_it(void) {
    prepare_bouncing(method, 1e-10);
    set(BEAD_x, 0.0);
    initialize();
    set_input_derivative(BEAD_lift, 1, g); // g (t - t^2 / 4), g at t = 2
    set_input_derivative(BEAD_lift, 2, -0.5 * g);
    run(0.0, 3.0, 1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.0, get(BEAD_v));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.0, get(BEAD_x));
}

/* Where the importer integrates, a lift that it takes back in Event Mode moves nothing. */
static void test_a_lift_taken_back_in_event_mode_moves_nothing(void) {
    for (int is_taken_back = 0; is_taken_back < 2; is_taken_back++) {
        struct discrete_update update;
        prepare_bouncing(1, 1e-8);
        set(BEAD_x, 0.0);
        begin_outside();
        set(BEAD_lift, 1.5 * g);
        instance_enter_event_mode(instance);
        set(BEAD_lift, is_taken_back ? 0.5 * g : 1.25 * g);
        ASSERT_OK(instance_update_discrete_states(instance, &update));
        TEST_ASSERT_EQUAL_INT(is_taken_back ? RESTS : FLIES, get_int(BEAD_mode));
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
        prepare_bouncing(1, 1e-8);
        begin_outside();
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
        TEST_ASSERT_EQUAL_INT(bounces, event_count());
        TEST_ASSERT_EQUAL_DOUBLE(bounces ? 0.4 : 0.0, last_event_time());
    }
}

static bool has_no_modes;

static enum status update_or_fail(void *values, const struct event *event) {
    return has_no_modes ? STATUS_NOT_FINITE : bead_model.events->update(values, event);
}

static void test_a_step_that_fails_at_once_leaves_the_time(void) {
    struct model_events events = *bead_model.events;
    struct model model = bead_model;
    struct model_description failing = model_description;
    events.update = update_or_fail;
    model.events = &events;
    failing.model = &model;
    prepare_as(&failing, 5.0, 1, 1e-8);
    set_bouncing();
    set(BEAD_x, 10.0);
    has_no_modes = false;
    initialize();
    for (int i = 0; i < 2; i++) { // nothing has been integrated yet; then there is a history
        const double time = 5.0 + i * 0.125;
        has_no_modes = true;
        set(BEAD_lift, 1.0 + i);
        TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE, instance_do_step(instance, time, 0.125, NULL));
        TEST_ASSERT_EQUAL_DOUBLE(time, instance_time(instance));
        TEST_ASSERT_EQUAL_DOUBLE(time, get(BEAD_time));
        has_no_modes = false;
        run(time, 0.125, 1);
    }
    tearDown();
}

static void test_a_bead_in_the_air_does_not_rest(void) {
    prepare_bouncing(1, 1e-8);
    set(BEAD_v, 2.0);
    initialize();
    run(0.0, 1e-3, 2);
    TEST_ASSERT_TRUE(instance->state.has_history && get(BEAD_x) > 1.0 && event_count() == 0);
    struct bead_values *now = (void *)instance->memory.values;
    struct bead_values *held = (void *)instance->memory.restart_values;
    assert_forged(&now->mode, &held->mode, 3, "mode = 3 is impossible");
    assert_forged(&now->mode, &held->mode, UNDECIDED, "the modes are impossible");
    assert_forged(&now->mode, &held->mode, RESTS, "the modes since the restart are impossible");
}
