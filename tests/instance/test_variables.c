#include "last_text.h"
#include "oscillator_by_hand.h"

#include <math.h>
#include <string.h>
#include <unity.h>

static const struct message_sink quiet;

void setUp(void) {
    last_text[0] = '\0';
}
static const struct variable *get(unsigned reference) {
    const struct variable *variable = variable_find(&oscillator_description, reference);
    TEST_ASSERT_NOT_NULL(variable);
    return variable;
}

static void test_every_row_is_found_by_its_reference(void) {
    for (size_t i = 0; i < oscillator_description.variable_count; i++) {
        const struct variable *row = &oscillator_description.variables[i];
        TEST_ASSERT_EQUAL_PTR(row, variable_find(&oscillator_description, row->reference));
    }
}

static void test_other_references_are_not_found(void) {
    const unsigned unknown[] = {3, 9, 79, 85, 86, 10000, 0x80000000u, 0xffffffffu};
    for (size_t i = 0; i < sizeof unknown / sizeof unknown[0]; i++) {
        TEST_ASSERT_NULL(variable_find(&oscillator_description, unknown[i]));
    }
}

/* Rows: notes 1, 3 and 6 of the table in section 4.2.4 of the standard. */
static void test_what_may_be_set_when(void) {
    const struct {
        unsigned reference;
        bool instantiated, initialization, stepping;
    } cases[] = {
        {OSCILLATOR_TIME, false, false, false},  {OSCILLATOR_OMEGA, true, true, true},
        {OSCILLATOR_GAIN, true, true, false},    {OSCILLATOR_X, true, true, false},
        {OSCILLATOR_U, true, true, true},        {OSCILLATOR_ENERGY, false, false, false},
        {OSCILLATOR_STEPS, false, false, false}, {OSCILLATOR_MAX_STEPS, true, true, false},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const struct variable *v = get(cases[i].reference);
        TEST_ASSERT_EQUAL_MESSAGE(cases[i].instantiated,
                                  variable_is_settable(v, PHASE_INSTANTIATED), v->name);
        TEST_ASSERT_EQUAL_MESSAGE(cases[i].initialization,
                                  variable_is_settable(v, PHASE_INITIALIZATION), v->name);
        TEST_ASSERT_EQUAL_MESSAGE(cases[i].stepping, variable_is_settable(v, PHASE_STEPPING),
                                  v->name);
    }
}

static void test_bounds_belong_to_the_range(void) {
    const struct variable *omega = get(OSCILLATOR_OMEGA);
    ASSERT_OK(variable_check_value(omega, -10.0, &quiet));
    ASSERT_OK(variable_check_value(omega, 100.0, &quiet));
    TEST_ASSERT_EQUAL_INT(STATUS_OUT_OF_RANGE, variable_check_value(omega, 100.5, &last_text_sink));
    TEST_ASSERT_EQUAL_STRING("omega = 100.5 is refused: a value from -10 to 100 is expected",
                             last_text);
    TEST_ASSERT_EQUAL_INT(STATUS_OUT_OF_RANGE,
                          variable_check_value(omega, nextafter(-10.0, -11.0), &quiet));
}

static void test_values_that_are_not_finite_are_refused_without_a_range_too(void) {
    const double values[] = {NAN, INFINITY, -INFINITY};
    for (size_t i = 0; i < 3; i++) {
        TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE,
                              variable_check_value(get(OSCILLATOR_X), values[i], &last_text_sink));
        TEST_ASSERT_NOT_NULL(strstr(last_text, "x = "));
        TEST_ASSERT_NOT_NULL(strstr(last_text, "a finite value is expected"));
    }
}
