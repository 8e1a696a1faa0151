/* The wheel in the core: Booleans and Integers by reference, which have no derivatives, steps that
 * end at an event, and which bindings and serialized states of what events keep are refused. */
#include "continuous_states.h"
#include "derivatives.h"
#include "model_description.h"
#include "one_instance.h"
#include "serialization.h"
#include "stepping.h"
#include "value_references.h"
#include "wheel.h"

#include <limits.h>
#include <stdlib.h>

static struct instance *initializing(void) {
    struct instance *made = created(&model_description);
    setup(made, 0.0, INFINITY);
    ASSERT_OK(instance_enter_initialization(made));
    return made;
}

void setUp(void) {
    last_text[0] = '\0';
    instance = initializing();
}

static enum status set_boolean(unsigned reference, int value) {
    return instance_set_boolean(instance, &reference, 1, &value);
}

static int get_boolean(struct instance *from, unsigned reference) {
    int value = -1;
    ASSERT_OK(instance_get_boolean(from, &reference, 1, &value));
    return value;
}

static int get_int32(struct instance *from, unsigned reference) {
    int value = -1;
    ASSERT_OK(instance_get_int32(from, &reference, 1, &value));
    return value;
}

static struct wheel_values *values_of(struct instance *of) {
    return (void *)of->memory.values;
}

/* ---- Discrete variables ---------------------------------------------------------------------- */

static void test_booleans_are_set_and_read_in_both_forms(void) {
    const unsigned both[] = {WHEEL_is_reversed, WHEEL_is_counting};
    bool read[2] = {true, false};
    ASSERT_OK(instance_get_bool(instance, both, 2, read));
    TEST_ASSERT_TRUE(!read[0] && read[1]); // start values
    const bool swapped[2] = {true, false};
    ASSERT_OK(instance_set_bool(instance, both, 2, swapped));
    TEST_ASSERT_EQUAL_INT(1, get_boolean(instance, WHEEL_is_reversed));
    TEST_ASSERT_EQUAL_INT(0, get_boolean(instance, WHEEL_is_counting));
    ASSERT_OK(set_boolean(WHEEL_is_counting, 1));
    ASSERT_OK(instance_get_bool(instance, both, 2, read));
    TEST_ASSERT_TRUE(read[0] && read[1]);
    instance_reset(instance);
    TEST_ASSERT_EQUAL_INT(0, get_boolean(instance, WHEEL_is_reversed));
    TEST_ASSERT_EQUAL_INT(1, get_boolean(instance, WHEEL_is_counting));
}

static void test_only_0_and_1_are_booleans(void) {
    const int wrong[] = {2, -1, INT_MAX};
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_EQUAL_INT(STATUS_OUT_OF_RANGE, set_boolean(WHEEL_is_counting, wrong[i]));
        assert_text("a value from 0 to 1 is expected");
    }
    const unsigned both[] = {WHEEL_is_reversed, WHEEL_is_counting};
    const unsigned char bytes[2] = {1, 2};
    TEST_ASSERT_EQUAL_INT(STATUS_OUT_OF_RANGE,
                          instance_set_bool(instance, both, 2, (const bool *)(const void *)bytes));
    assert_text("is_counting = 2 is refused");
    TEST_ASSERT_EQUAL_INT(0, get_boolean(instance, WHEEL_is_reversed)); // all or nothing
    TEST_ASSERT_EQUAL_INT(1, get_boolean(instance, WHEEL_is_counting));
}

static void test_other_types_and_references_are_refused(void) {
    static const struct {
        unsigned reference;
        const char *text;
    } cases[] = {
        {WHEEL_speed, "speed (value reference 20) is accessed as boolean: it is of type float64"},
        {WHEEL_turns, "turns (value reference 30) is accessed as boolean: it is of type int32"},
        {WHEEL_solver_method, "accessed as boolean: it is of type enumeration"},
        {99, "value reference 99 is unknown"},
        {100000, "value reference 100000 is unknown"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const bool on = true;
        int read = 7;
        ASSERT_REFUSED(set_boolean(cases[i].reference, 1));
        assert_text(cases[i].text);
        ASSERT_REFUSED(instance_set_bool(instance, &cases[i].reference, 1, &on));
        assert_text(cases[i].text);
        ASSERT_REFUSED(instance_get_boolean(instance, &cases[i].reference, 1, &read));
        assert_text(cases[i].text);
        TEST_ASSERT_EQUAL_INT(7, read);
    }
    const unsigned counting = WHEEL_is_counting;
    const double one = 1.0;
    const int on = 1;
    ASSERT_REFUSED(instance_set_real(instance, &counting, 1, &one));
    assert_text("is_counting (value reference 21) is accessed as float64: it is of type boolean");
    ASSERT_REFUSED(instance_set_integer(instance, &counting, 1, &on));
    assert_text("is accessed as int32: it is of type boolean");
}

static void test_calculated_integers_and_booleans_are_up_to_date(void) {
    set(WHEEL_angle, 20.0); // 3.18 turns
    TEST_ASSERT_EQUAL_INT(3, get_int32(instance, WHEEL_turns));
    TEST_ASSERT_EQUAL_INT(0, get_boolean(instance, WHEEL_is_turning));
    set(WHEEL_speed, -2.0);
    TEST_ASSERT_EQUAL_INT(1, get_boolean(instance, WHEEL_is_turning));
    ASSERT_OK(set_boolean(WHEEL_is_counting, 0));
    TEST_ASSERT_EQUAL_INT(0, get_int32(instance, WHEEL_turns));
    ASSERT_OK(set_boolean(WHEEL_is_counting, 1));
    ASSERT_OK(set_boolean(WHEEL_is_reversed, 1));
    TEST_ASSERT_EQUAL_INT(-3, get_int32(instance, WHEEL_turns));
    ASSERT_OK(set_boolean(WHEEL_is_reversed, 0));
    ASSERT_OK(instance_exit_initialization(instance));
    ASSERT_OK(instance_do_step(instance, 0.0, 5.0, NULL)); // to 10 rad
    TEST_ASSERT_EQUAL_INT(1, get_int32(instance, WHEEL_turns));
}

/* What cannot be calculated is not read; what events keep needs no calculation. */
static void test_integers_that_cannot_be_calculated_are_not_read(void) {
    const unsigned turns = WHEEL_turns;
    const unsigned turning = WHEEL_is_turning;
    int value = 7;
    bool flag = true;
    set(WHEEL_angle, 1e30);
    TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE, instance_get_int32(instance, &turns, 1, &value));
    TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE, instance_get_bool(instance, &turning, 1, &flag));
    TEST_ASSERT_TRUE(value == 7 && flag);
    TEST_ASSERT_EQUAL_INT(0, get_int32(instance, WHEEL_catches));
    TEST_ASSERT_EQUAL_INT(0, get_boolean(instance, WHEEL_is_caught));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get(WHEEL_lost_speed));
}

static void test_when_booleans_can_be_set(void) {
    ASSERT_OK(instance_exit_initialization(instance));
    ASSERT_OK(set_boolean(WHEEL_is_counting, 0));
    ASSERT_OK(set_boolean(WHEEL_is_reversed, 1)); // tunable
    ASSERT_REFUSED(set_boolean(WHEEL_is_turning, 1));
    assert_text("is_turning (value reference 31) cannot be set after initialization");

    ASSERT_OK(instance_enter_continuous_time(instance));
    ASSERT_REFUSED(set_boolean(WHEEL_is_counting, 1));
    assert_text("is_counting (value reference 21) cannot be set while the time is continuous");
    set(WHEEL_speed, 1.0);
    TEST_ASSERT_EQUAL_INT(0, get_boolean(instance, WHEEL_is_counting));
    instance_enter_event_mode(instance);
    ASSERT_OK(set_boolean(WHEEL_is_counting, 1));
}

static void test_only_reals_have_derivatives(void) {
    const unsigned speed = WHEEL_speed;
    const unsigned rate = WHEEL_rate;
    const int order = 1;
    const double one = 1.0;
    double result = 7.0;
    ASSERT_OK(instance_get_directional_derivative(instance, KNOWN_MOTION, &rate, 1, &speed, 1, &one,
                                                  &result));
    TEST_ASSERT_EQUAL_DOUBLE(1.0, result);
    const struct {
        unsigned unknown, known;
        const char *text;
    } cases[] = {
        {WHEEL_rate, WHEEL_is_counting,
         "is_counting (value reference 21) is refused: it is of type boolean, an input, a state"},
        {WHEEL_rate, WHEEL_is_reversed,
         "is_reversed (value reference 2) is refused: it is of type"},
        {WHEEL_is_caught, WHEEL_speed, "it is of type boolean, an output, a local or a derivative"},
        {WHEEL_turns, WHEEL_speed, "it is of type int32, an output, a local or a derivative"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        ASSERT_REFUSED(instance_get_directional_derivative(
            instance, KNOWN_ARGUMENTS, &cases[i].unknown, 1, &cases[i].known, 1, &one, &result));
        assert_text(cases[i].text);
        ASSERT_REFUSED(instance_get_adjoint_derivative(instance, KNOWN_ARGUMENTS, &cases[i].unknown,
                                                       1, &cases[i].known, 1, &one, &result));
        assert_text(cases[i].text);
    }
    const unsigned outputs[] = {WHEEL_is_turning, WHEEL_turns};
    for (size_t i = 0; i < 2; i++) {
        ASSERT_REFUSED(instance_get_output_derivatives(instance, &outputs[i], 1, &order, &result));
        assert_text("is refused: it is ");
    }
    TEST_ASSERT_EQUAL_DOUBLE(1.0, result);

    const unsigned both[] = {WHEEL_lost_speed, WHEEL_rate}; // the first one is held between events
    double results[] = {7.0, 7.0};
    ASSERT_OK(instance_get_directional_derivative(instance, KNOWN_MOTION, both, 2, &speed, 1, &one,
                                                  results));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, results[0]);
    TEST_ASSERT_EQUAL_DOUBLE(1.0, results[1]);
    ASSERT_OK(instance_get_output_derivatives(instance, both, 1, &order, results));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, results[0]);
    ASSERT_REFUSED(instance_get_directional_derivative(instance, KNOWN_ARGUMENTS, &rate, 1, both, 1,
                                                       &one, results));
    assert_text("lost_speed (value reference 42) is refused: an input, a state");

    const unsigned counting = WHEEL_is_counting;
    ASSERT_REFUSED(instance_set_input_derivatives(instance, &counting, 1, &order, &one));
    assert_text("it is of type boolean, a continuous input of type float64 is expected");
    TEST_ASSERT_EQUAL_DOUBLE(1.0, result);
}

/* ---- Steps that end at an event, and how the next one continues ------------------------------ */

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
    ASSERT_OK(instance_do_step(instance, now, end - now, &options));
}

static void step(enum event_handling at_event) {
    const struct step_options options = {.at_event = at_event};
    ASSERT_OK(instance_do_step(instance, start_time, 0.1, &options));
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
    ASSERT_OK(instance_do_step(instance, 0.0, 0.5, NULL));
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
