/* What an instance checks when it is created, and its life: reset, nominal values. */
#include "continuous_states.h"
#include "one_instance.h"
#include "oscillator_by_hand.h"

void setUp(void) {
    create(&oscillator_description);
}

/* The texts of one call, one after the other. */
static char texts[1000];

static void collect(void *context, enum status status, const char *text) {
    (void)strncat(texts, text, sizeof texts - strlen(texts) - 1);
}

/* The first row is checked as all others: tests/wheel/test_wheel_states.c. */
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
