/* Serialized states whose modes cannot be are refused. */
#include "serialization.h"
#include "toy_run.h"

/* Moving, within the integrator's history. */
static void start(const struct model_description *description) {
    prepare(description, 1, 1e-8);
    set(TOY_POSITION, 1.0);
    set(TOY_SPEED, 2.0);
    initialize();
    run(0.0, 1e-3, 2);
    TEST_ASSERT_TRUE(instance->state.has_history && get(TOY_POSITION) > 1.0 &&
                     get_int(TOY_EVENTS) == 0);
}

static enum status pass_on(void) {
    struct instance_snapshot *snapshot = NULL;
    struct instance_snapshot *read = NULL;
    unsigned char bytes[2000];
    const size_t size = instance_serialized_size(instance);
    TEST_ASSERT_LESS_OR_EQUAL_size_t(sizeof bytes, size);
    ASSERT_OK(instance_save(instance, 0, &snapshot));
    ASSERT_OK(instance_serialize(instance, snapshot, bytes, size));
    last_text[0] = '\0';
    return instance_deserialize(instance, bytes, size, &read);
}

static void check(int *now, int *since_restart, int mode, const char *text) {
    const int kept = *now;
    *now = *since_restart = mode;
    ASSERT_REFUSED(pass_on());
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(last_text, text), last_text);
    *since_restart = kept;
    ASSERT_REFUSED(pass_on());
    *now = kept;
    ASSERT_OK(pass_on());
}

static void test_a_ball_in_the_air_does_not_rest(void) {
    start(&ball_description);
    struct ball_values *now = (void *)instance->memory.values;
    struct ball_values *held = (void *)instance->memory.restart_values;
    check(&now->is_resting, &held->is_resting, 2, "the modes are impossible");
    check(&now->is_resting, &held->is_resting, -1, "the modes are impossible");
    check(&now->is_resting, &held->is_resting, 1, "the modes since the restart are impossible");
}

/* What update writes is 0 until it is called. */
static void test_no_stroke_before_the_start(void) {
    prepare(&hammer_description, 1, 1e-8);
    struct hammer_values *now = (void *)instance->memory.values;
    ASSERT_OK(pass_on());
    now->start = 1.0;
    ASSERT_REFUSED(pass_on());
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(last_text, "the modes are impossible"), last_text);
}

static void test_a_block_slides_where_its_velocity_points(void) {
    start(&block_description);
    struct block_values *now = (void *)instance->memory.values;
    struct block_values *held = (void *)instance->memory.restart_values;
    check(&now->direction, &held->direction, 2, "the modes are impossible");
    check(&now->direction, &held->direction, -2, "the modes are impossible");
    check(&now->direction, &held->direction, -1, "the modes since the restart are impossible");
    check(&now->direction, &held->direction, 0, "the modes since the restart are impossible");
}
