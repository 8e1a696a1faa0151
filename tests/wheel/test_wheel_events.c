/* The wheel's own events: when its stop catches it and lets it go, and the kinds of its indicators.
 */
#include "wheel.h"

#include <unity.h>

static struct wheel_values values;
static struct indicator indicators[2];

void setUp(void) {
    values = (struct wheel_values){.stop = 2.0, .speed = 3.0, .angle = 1.5};
}

static void update(const bool triggered[2]) {
    const struct event event = {.triggered = triggered};
    TEST_ASSERT_EQUAL_INT(STATUS_OK, wheel_model.events->update(&values, &event));
}

static void read_indicators(double z[2]) {
    wheel_model.events->describe(&values, indicators);
    TEST_ASSERT_EQUAL_INT(
        STATUS_OK, wheel_model.events->indicators(&values, 0.0, &values.angle, &values.speed, z));
}

static double rate(void) {
    double dx = -1.0;
    TEST_ASSERT_EQUAL_INT(
        STATUS_OK, wheel_model.right_hand_side(&values, 0.0, &values.angle, &values.speed, &dx));
    return dx;
}

static void test_the_stop_catches_the_wheel_and_lets_it_go(void) {
    const bool at_stop[2] = {true, false};
    const bool push_ends[2] = {false, true};
    double z[2];
    update(NULL);
    TEST_ASSERT_FALSE(values.is_caught);
    read_indicators(z);
    TEST_ASSERT_TRUE(z[0] == 0.5 && z[1] == 1.0);
    TEST_ASSERT_EQUAL_INT(INDICATOR_OF_STATE, indicators[0].kind);
    TEST_ASSERT_TRUE(indicators[0].offset + indicators[0].factor * values.angle == z[0]);
    TEST_ASSERT_EQUAL_INT(INDICATOR_UNUSED, indicators[1].kind);

    values.angle = 2.0 - 1e-15; // as a root is found
    update(at_stop);
    for (int again = 0; again < 2; again++) {
        TEST_ASSERT_TRUE(values.is_caught && wheel_model.events->is_at_rest(&values));
        TEST_ASSERT_EQUAL_INT(1, values.catches);
        TEST_ASSERT_TRUE(values.angle == 2.0 && values.lost_speed == 3.0 && rate() == 0.0);
        update(NULL);
    }
    read_indicators(z);
    TEST_ASSERT_TRUE(z[0] == 1.0 && z[1] == 3.0);
    TEST_ASSERT_EQUAL_INT(INDICATOR_UNUSED, indicators[0].kind);
    TEST_ASSERT_EQUAL_INT(INDICATOR_OF_MODEL, indicators[1].kind);

    values.speed = 0.0;
    update(push_ends);
    for (int again = 0; again < 2; again++) {
        TEST_ASSERT_FALSE(values.is_caught || wheel_model.events->is_at_rest(&values));
        update(NULL);
    }
    values.speed = -1.0;
    update(NULL);
    TEST_ASSERT_TRUE(rate() == -1.0 && values.catches == 1 && values.lost_speed == 3.0);
}

static void test_a_speed_that_turns_back_lets_it_go(void) {
    values.angle = values.stop;
    update(NULL);
    TEST_ASSERT_TRUE(values.is_caught);
    values.speed = -1.0;
    update(NULL);
    TEST_ASSERT_FALSE(values.is_caught);
}

static void test_without_a_stop_nothing_happens(void) {
    const bool at_stop[2] = {true, false};
    double z[2];
    values.stop = 0.0;
    TEST_ASSERT_FALSE(wheel_model.events->are_possible(&values));
    update(at_stop);
    TEST_ASSERT_FALSE(values.is_caught);
    read_indicators(z);
    TEST_ASSERT_TRUE(z[0] == 1.0 && z[1] == 1.0);
    TEST_ASSERT_EQUAL_INT(INDICATOR_UNUSED, indicators[0].kind);

    values.is_caught = 1; // by a stop that is gone
    update(NULL);
    TEST_ASSERT_FALSE(values.is_caught);
}

/* Central differences of the outputs, which are linear in all of it. */
static void test_derivatives_are_those_of_the_outputs(void) {
    const struct wheel_values along = {.stop = 0.25, .speed = -2.0, .angle = 0.5};
    for (int caught = 0; caught < 2; caught++) {
        struct wheel_values ends[2];
        struct wheel_values first = along;
        values.is_caught = caught;
        TEST_ASSERT_EQUAL_INT(STATUS_OK, wheel_model.propagate(&values, 0.0, 0.0, &first, NULL));
        for (int i = 0; i < 2; i++) {
            const double s = i == 0 ? -0.125 : 0.125;
            ends[i] = values;
            ends[i].stop += s * along.stop;
            ends[i].speed += s * along.speed;
            ends[i].angle += s * along.angle;
            TEST_ASSERT_EQUAL_INT(STATUS_OK, wheel_model.outputs(&ends[i], 0.0));
        }
        TEST_ASSERT_TRUE(first.rate == (ends[1].rate - ends[0].rate) * 4.0);
        TEST_ASSERT_TRUE(first.to_stop == (ends[1].to_stop - ends[0].to_stop) * 4.0);
        TEST_ASSERT_TRUE(first.push == (ends[1].push - ends[0].push) * 4.0);
    }
}
