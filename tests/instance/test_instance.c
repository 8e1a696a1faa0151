#include "continuous_states.h"
#include "one_instance.h"
#include "oscillator_by_hand.h"

void setUp(void) {
    create(&oscillator_description);
}

/* ---- Times ---------------------------------------------------------------------------------- */

static void test_a_master_that_accumulates_its_time_reaches_the_stop_time(void) {
    initialize_of(instance, 0.0, 600.0);
    double t = 0.0;
    for (int i = 0; i < 600000; i++) {
        ASSERT_OK(instance_do_step(instance, t, 1e-3));
        t += 1e-3;
    }
    double exact[2] = {1.0, 0.0};
    oscillator_solution(2.0, 0.0, t, exact, exact);
    TEST_ASSERT_EQUAL_DOUBLE(t, instance_time(instance));
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, exact[0], get(OSCILLATOR_X));
}

static void test_a_small_mismatch_of_the_time_is_integrated(void) {
    double exact[2] = {1.0, 0.0};
    initialize_at(0.0);
    ASSERT_OK(instance_do_step(instance, 0.0, 1.0));
    ASSERT_OK(instance_do_step(instance, 1.0 + 1e-10, 0.5));
    oscillator_solution(2.0, 0.0, 1.5 + 1e-10, exact, exact);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, exact[0], get(OSCILLATOR_X));
    TEST_ASSERT_EQUAL_DOUBLE(1.5 + 1e-10, instance_time(instance));
}

/* ---- Life ----------------------------------------------------------------------------------- */

/* As if variables.toml named a calculated field for the input: it compiles and would do nothing. */
static void test_a_field_of_another_kind_is_refused(void) {
    struct variable variables[16];
    struct model_description wrong = oscillator_description;
    struct instance *none = instance;
    TEST_ASSERT_TRUE(oscillator_description.variable_count <= 16);
    for (size_t i = 0; i < oscillator_description.variable_count; i++) {
        variables[i] = oscillator_description.variables[i];
        if (variables[i].reference == OSCILLATOR_U) {
            variables[i].offset = offsetof(struct oscillator_values, energy);
        }
    }
    wrong.variables = variables;
    TEST_ASSERT_EQUAL_INT(STATUS_INTERNAL, instance_create(&wrong, &last_text_sink, &none));
    TEST_ASSERT_NULL(none);
}

/* The texts of one call, one after the other. */
static char texts[1000];

static void collect(void *context, enum status status, const char *text) {
    (void)strncat(texts, text, sizeof texts - strlen(texts) - 1);
}

/* The first row is checked as all others. */
static void test_a_wrong_field_in_the_first_row_is_refused(void) {
    struct variable variable = oscillator_description.variables[1]; // omega, a parameter
    struct model_description wrong = oscillator_description;
    struct instance *none = instance;
    variable.offset = offsetof(struct oscillator_values, energy);
    wrong.variables = &variable;
    wrong.variable_count = 1;
    const struct message_sink sink = {.write = collect};
    texts[0] = '\0';
    TEST_ASSERT_EQUAL_INT(STATUS_INTERNAL, instance_create(&wrong, &sink, &none));
    TEST_ASSERT_NULL(none);
    TEST_ASSERT_NOT_NULL(strstr(texts, "omega is bound to a field"));
}

/* Nominal values are found wherever in the table a state stands. */
static void test_nominal_values_of_states_in_the_first_rows(void) {
    struct variable rows[2];
    struct model_description states_only = oscillator_description;
    struct instance *made = NULL;
    double nominals[2] = {0.0, 0.0};
    for (size_t i = 0, row = 0; i < oscillator_description.variable_count; i++) {
        const struct variable *variable = &oscillator_description.variables[i];
        if (variable->reference == OSCILLATOR_X || variable->reference == OSCILLATOR_V) {
            rows[row] = *variable;
            rows[row].nominal = 5.0 + (double)row;
            row++;
        }
    }
    states_only.variables = rows;
    states_only.variable_count = 2;
    ASSERT_OK(instance_create(&states_only, &last_text_sink, &made));
    ASSERT_OK(instance_get_nominals(made, nominals, 2));
    TEST_ASSERT_EQUAL_DOUBLE(5.0, nominals[0]);
    TEST_ASSERT_EQUAL_DOUBLE(6.0, nominals[1]);
    instance_destroy(made);
}

/* What was calculated before a reset does not show after it. */
static void test_calculated_values_follow_a_reset(void) {
    const double fresh = get(OSCILLATOR_ENERGY);
    set(OSCILLATOR_X, 3.0);
    TEST_ASSERT_TRUE(get(OSCILLATOR_ENERGY) > fresh);
    instance_reset(instance);
    TEST_ASSERT_TRUE(get(OSCILLATOR_ENERGY) == fresh);
}

/* ---- Values --------------------------------------------------------------------------------- */

static void test_the_parameter_wins_over_the_experiment_over_the_default(void) {
    const struct instance_experiment experiment = {.tolerance_defined = true, .tolerance = 1e-6};
    const double by_default = get(OSCILLATOR_EFFECTIVE_TOLERANCE);
    TEST_ASSERT_TRUE(by_default > 0.0 && by_default <= 1e-8);

    ASSERT_OK(instance_setup_experiment(instance, &experiment));
    TEST_ASSERT_DOUBLE_WITHIN(1e-20, 1e2 * by_default, get(OSCILLATOR_EFFECTIVE_TOLERANCE));
    set(OSCILLATOR_RELATIVE_TOLERANCE, 1e-9);
    TEST_ASSERT_DOUBLE_WITHIN(1e-20, 1e-1 * by_default, get(OSCILLATOR_EFFECTIVE_TOLERANCE));

    // what cannot be kept is not promised
    set(OSCILLATOR_RELATIVE_TOLERANCE, 1e-300);
    TEST_ASSERT_TRUE(get(OSCILLATOR_EFFECTIVE_TOLERANCE) >= 1e-15);
    set(OSCILLATOR_RELATIVE_TOLERANCE, 1e300);
    TEST_ASSERT_TRUE(get(OSCILLATOR_EFFECTIVE_TOLERANCE) < 1.0);
}

static void test_outputs_follow_what_was_set_last(void) {
    initialize_at(0.0);
    TEST_ASSERT_EQUAL_DOUBLE(2.0, get(OSCILLATOR_ENERGY));
    set(OSCILLATOR_OMEGA, 4.0);
    TEST_ASSERT_EQUAL_DOUBLE(8.0, get(OSCILLATOR_ENERGY));
}

static void test_settings_are_closed_after_initialization(void) {
    const unsigned limit = OSCILLATOR_MAX_STEPS;
    const int value = 5;
    initialize_at(0.0);
    ASSERT_REFUSED(instance_set_integer(instance, &limit, 1, &value));
    ASSERT_REFUSED(try_set(OSCILLATOR_X, 2.0));
    TEST_ASSERT_NOT_NULL(strstr(last_text, "only inputs and tunable parameters can"));
    ASSERT_REFUSED(try_set(OSCILLATOR_GAIN, 2.0));
}
