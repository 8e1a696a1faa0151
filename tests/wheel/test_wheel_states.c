/* Which bindings and which serialized states of what events keep are refused. */
#include "serialization.h"
#include "stepping.h"
#include "wheel_instance.h"

#include <stdlib.h>

/* ---- States --------------------------------------------------------------------------------- */

static struct wheel_values *held(void) {
    return (void *)instance->memory.restart_values;
}

static bool other_is_integrated_outside;

/* What a second instance makes of the serialized state of the first one. */
static enum status transfer(struct instance **other) {
    struct instance_snapshot *snapshot = NULL;
    ASSERT_OK(instance_save(instance, 0, &snapshot));
    const size_t size = instance_serialized_size(instance);
    unsigned char *bytes = malloc(size);
    TEST_ASSERT_NOT_NULL(bytes);
    ASSERT_OK(instance_serialize(instance, snapshot, bytes, size));
    *other = initializing();
    (*other)->is_integrated_outside = other_is_integrated_outside;
    struct instance_snapshot *read = NULL;
    enum status status = instance_deserialize(*other, bytes, size, &read);
    if (status == STATUS_OK) {
        status = instance_restore(*other, read);
    }
    free(bytes);
    return status;
}

static void assert_forged_is_refused(const char *text) {
    struct instance *other;
    last_text[0] = '\0';
    TEST_ASSERT_EQUAL_INT_MESSAGE(STATUS_INVALID_ARGUMENT, transfer(&other), text);
    assert_text(text);
    instance_destroy(other);
}

static void assert_accepted(void) {
    struct instance *other;
    ASSERT_OK(transfer(&other));
    instance_destroy(other);
}

static void assert_event_points_are_possible(void) {
    const struct instance_state kept = instance->state;
    instance->state.event_point = EVENT_HANDLED;
    assert_forged_is_refused("event_point = 2 is impossible"); // before initialization ends
    instance->state.phase = PHASE_STEPPING;
    other_is_integrated_outside = true;
    assert_forged_is_refused("event_point = 2 is impossible"); // it makes no steps
    other_is_integrated_outside = false;
    instance->state.event_point = (enum event_point)3;
    assert_forged_is_refused("event_point = 3 is impossible");
    instance->state.event_point = EVENT_UNHANDLED;
    assert_forged_is_refused("causes of the unhandled event = 0 is impossible");
    instance->state = kept;
    instance->memory.unhandled[1] = true;
    assert_forged_is_refused("causes of the unhandled event = 1 is impossible");
    instance->memory.unhandled[1] = false;
    instance->state.cut_end.s = NAN;
    assert_forged_is_refused("the end of the step cut short = nan is impossible");
    instance->state = kept;
}

static void test_forged_states_are_refused_with_the_value(void) {
    const struct {
        int *field;
        int value;
        const char *text;
    } cases[] = {
        {&values_of(instance)->is_counting, 2, "is_counting = 2 is impossible"},
        {&values_of(instance)->is_reversed, -1, "is_reversed = -1 is impossible"},
        {&values_of(instance)->is_caught, 3, "is_caught = 3 is impossible"},
        {&values_of(instance)->catches, -1, "catches = -1 is impossible"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const int kept = *cases[i].field;
        *cases[i].field = cases[i].value;
        assert_forged_is_refused(cases[i].text);
        *cases[i].field = kept;
    }
    values_of(instance)->lost_speed = INFINITY;
    assert_forged_is_refused("lost_speed = inf is impossible");
    values_of(instance)->lost_speed = 0.0;
    values_of(instance)->turns = 1234; // calculated: not among the bytes
    assert_event_points_are_possible();
    assert_accepted();
}

static void test_no_mode_is_decided_before_the_initialization_ends(void) {
    assert_accepted();
    values_of(instance)->is_caught = 1;
    assert_forged_is_refused("the modes are impossible");
    ASSERT_OK(instance_exit_initialization(instance));
    values_of(instance)->is_caught = 1; // nothing has been held so far
    assert_accepted();
}

/* While the integrator continues, the modes are those of its restart and fit its parameters. */
static void test_forged_modes_since_the_restart_are_refused(void) {
    set(WHEEL_stop, 1.0);
    ASSERT_OK(instance_exit_initialization(instance));
    ASSERT_OK(instance_do_step(instance, 0.0, 0.5));
    TEST_ASSERT_TRUE(instance->state.has_history);
    assert_accepted();
    values_of(instance)->catches = 1;
    assert_forged_is_refused("the modes since the restart are impossible");
    held()->catches = 1;
    assert_accepted();
    values_of(instance)->is_caught = held()->is_caught = 1;
    assert_accepted(); // as far as one can see from here
    held()->stop = 0.0;
    assert_forged_is_refused("the modes since the restart are impossible");
    values_of(instance)->stop = 0.0; // set after the restart it would not matter
    assert_forged_is_refused("the modes since the restart are impossible");
    instance->state.has_history = false;
    assert_accepted();
}

/* ---- Bindings ------------------------------------------------------------------------------- */

enum { MOST_VARIABLES = 64 };
static struct variable rows[MOST_VARIABLES];

/* A description whose rows can be changed. */
static struct model_description changeable(void) {
    struct model_description copy = model_description;
    TEST_ASSERT_LESS_OR_EQUAL_size_t(MOST_VARIABLES, model_description.variable_count);
    memcpy(rows, model_description.variables, model_description.variable_count * sizeof rows[0]);
    copy.variables = rows;
    return copy;
}

static struct variable *row_of(unsigned reference) {
    return &rows[model_description.row_of_reference[reference]];
}

/* All texts of one call. */
static char texts[1000];

static void collect(void *context, enum status status, const char *text) {
    (void)strncat(texts, text, sizeof texts - strlen(texts) - 1);
}

static void assert_no_instance(const struct model_description *wrong, const char *text) {
    const struct message_sink sink = {.write = collect};
    struct instance *none = instance;
    texts[0] = '\0';
    TEST_ASSERT_EQUAL_INT_MESSAGE(STATUS_INTERNAL, instance_create(wrong, &sink, &none), text);
    TEST_ASSERT_NULL(none);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(texts, text), texts);
}

static void test_the_number_of_indicators_is_checked(void) {
    struct model_description wrong = changeable();
    wrong.indicator_count = 1;
    assert_no_instance(&wrong, "1 event indicators of Wheel are declared: its model has 2");
    struct model without = wheel_model;
    without.events = NULL;
    wrong = changeable();
    wrong.model = &without;
    assert_no_instance(&wrong, "2 event indicators of Wheel are declared: its model has 0");
}

static void test_wrong_bindings_of_discrete_variables_are_refused(void) {
    static const struct {
        unsigned reference;
        size_t offset;
    } moved[] = {
        {WHEEL_is_counting, offsetof(struct wheel_values, is_turning)},
        {WHEEL_is_counting, offsetof(struct wheel_values, is_caught)},
        {WHEEL_is_counting, offsetof(struct wheel_values, speed)},
        {WHEEL_is_reversed, offsetof(struct wheel_values, is_turning)},
        {WHEEL_is_reversed, offsetof(struct wheel_values, is_counting)},
        {WHEEL_is_turning, offsetof(struct wheel_values, is_reversed)},
        {WHEEL_speed, offsetof(struct wheel_values, rate)},
        {WHEEL_rate, offsetof(struct wheel_values, speed)},
        {WHEEL_speed, offsetof(struct wheel_values, is_counting)},
        {WHEEL_is_turning, offsetof(struct wheel_values, is_counting)},
        {WHEEL_lost_speed, offsetof(struct wheel_values, is_caught)},
        {WHEEL_catches, offsetof(struct wheel_values, lost_speed)},
    };
    for (size_t i = 0; i < sizeof moved / sizeof moved[0]; i++) {
        struct model_description wrong = changeable();
        row_of(moved[i].reference)->offset = moved[i].offset;
        assert_no_instance(&wrong, "is bound to a field that is not of its kind");
    }
    // only events write what they keep
    struct model_description wrong = changeable();
    row_of(WHEEL_is_caught)->initial = INITIAL_EXACT;
    assert_no_instance(&wrong, "is_caught is bound to a field");
    wrong = changeable();
    row_of(WHEEL_lost_speed)->variability = VARIABILITY_CONTINUOUS;
    assert_no_instance(&wrong, "lost_speed is bound to a field");
}

/* A sum that is no variable. */
static void test_a_forged_discrete_state_without_a_name_is_refused(void) {
    struct model_description fewer = changeable();
    short table[WHEEL_lost_speed + 1];
    fewer.variable_count = (size_t)model_description.row_of_reference[WHEEL_lost_speed];
    fewer.reference_count = WHEEL_lost_speed;
    memcpy(table, model_description.row_of_reference, sizeof table);
    fewer.row_of_reference = table;
    struct instance *named = instance;
    ASSERT_OK(instance_create(&fewer, &last_text_sink, &instance));
    instance_destroy(named);
    values_of(instance)->lost_speed = NAN;

    struct instance_snapshot *snapshot = NULL;
    struct instance_snapshot *read = NULL;
    unsigned char bytes[2000];
    const size_t size = instance_serialized_size(instance);
    TEST_ASSERT_LESS_OR_EQUAL_size_t(sizeof bytes, size);
    instance->state.own.max_internal_steps = 1; // the variable, too, is left out
    ASSERT_OK(instance_save(instance, 0, &snapshot));
    ASSERT_OK(instance_serialize(instance, snapshot, bytes, sizeof bytes));
    ASSERT_REFUSED(instance_deserialize(instance, bytes, size, &read));
    assert_text("a discrete state = nan is impossible");
}
