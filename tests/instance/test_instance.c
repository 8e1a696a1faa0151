#include "instance.h"

#include "continuous_states.h"
#include "last_text.h"
#include "oscillator_by_hand.h"
#include "stepping.h"
#include "values.h"

#include <math.h>
#include <string.h>
#include <unity.h>

static struct instance *instance;

static struct instance *create(void) {
    struct instance *created = NULL;
    TEST_ASSERT_EQUAL_INT(STATUS_OK,
                          instance_create(&oscillator_description, &last_text_sink, &created));
    return created;
}

void setUp(void) {
    memset(last_text, 0, sizeof last_text);
    instance = create();
}

void tearDown(void) {
    instance_destroy(instance);
}

static double get(struct instance *from, unsigned reference) {
    double value = NAN;
    ASSERT_OK(instance_get_real(from, &reference, 1, &value));
    return value;
}

static enum status set(struct instance *to, unsigned reference, double value) {
    return instance_set_real(to, &reference, 1, &value);
}

static void setup(struct instance *started, double start) {
    const struct instance_experiment experiment = {.start_time = start};
    ASSERT_OK(instance_setup_experiment(started, &experiment));
}

static void initialize(struct instance *started, double start) {
    setup(started, start);
    ASSERT_OK(instance_enter_initialization(started));
    ASSERT_OK(instance_exit_initialization(started));
}

/* Through initialization, from 0 s on. */
static void initialize_until(struct instance *started, double stop) {
    const struct instance_experiment experiment = {.stop_time_defined = true, .stop_time = stop};
    ASSERT_OK(instance_setup_experiment(started, &experiment));
    ASSERT_OK(instance_enter_initialization(started));
    ASSERT_OK(instance_exit_initialization(started));
}

/* An experiment whose input changes at every third step. */
static void run(struct instance *stepped, int steps, double states[2]) {
    for (int i = 0; i < steps; i++) {
        ASSERT_OK(set(stepped, OSCILLATOR_U, sin((i / 3) * 0.1)));
        ASSERT_OK(instance_do_step(stepped, i * 0.01, 0.01));
    }
    states[0] = get(stepped, OSCILLATOR_X);
    states[1] = get(stepped, OSCILLATOR_V);
}

/* ---- Times ---------------------------------------------------------------------------------- */

static void test_the_start_time_does_not_change_the_motion(void) {
    const double starts[] = {-0.5, 1000.0, 1e6};
    double reference[2];
    double states[2];
    initialize(instance, 0.0);
    run(instance, 100, reference);
    for (int k = 0; k < 3; k++) {
        instance_reset(instance);
        initialize(instance, starts[k]);
        for (int i = 0; i < 100; i++) {
            ASSERT_OK(set(instance, OSCILLATOR_U, sin((i / 3) * 0.1)));
            ASSERT_OK(instance_do_step(instance, starts[k] + i * 0.01, 0.01));
        }
        states[0] = get(instance, OSCILLATOR_X);
        states[1] = get(instance, OSCILLATOR_V);
        // the communication points of this master are rounded to 1e-10 s at 1e6 s
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, reference[0], states[0]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, reference[1], states[1]);
    }
}

static void test_a_master_that_accumulates_its_time_reaches_the_stop_time(void) {
    initialize_until(instance, 600.0);
    double t = 0.0;
    for (int i = 0; i < 600000; i++) {
        ASSERT_OK(instance_do_step(instance, t, 1e-3));
        t += 1e-3;
    }
    double exact[2] = {1.0, 0.0};
    oscillator_solution(2.0, 0.0, t, exact, exact);
    TEST_ASSERT_EQUAL_DOUBLE(t, instance_time(instance));
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, exact[0], get(instance, OSCILLATOR_X));
}

static void test_a_small_mismatch_of_the_time_is_integrated(void) {
    double exact[2] = {1.0, 0.0};
    initialize(instance, 0.0);
    ASSERT_OK(instance_do_step(instance, 0.0, 1.0));
    ASSERT_OK(instance_do_step(instance, 1.0 + 1e-10, 0.5));
    oscillator_solution(2.0, 0.0, 1.5 + 1e-10, exact, exact);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, exact[0], get(instance, OSCILLATOR_X));
    TEST_ASSERT_EQUAL_DOUBLE(1.5 + 1e-10, instance_time(instance));
}

static void test_times_that_do_not_fit_are_refused(void) {
    const struct {
        double t, h;
        const char *expected;
    } cases[] = {
        {0.0, 0.0, "a step of 0 s"},
        {0.0, -0.1, "a step of -0.1 s"},
        {0.0, NAN, "nan s from t = 0"},
        {0.0, INFINITY, "inf s"},
        {NAN, 0.1, "from t = nan"},
        {0.01, 0.1, "a step from t = 0.01 is refused: the instance is at t = 0"},
        {-0.01, 0.1, "the instance is at t = 0"},
        {1e9, 1e-9, "does not change the time"},
        {0.0, 2.5, "the stop time is 2"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        instance_reset(instance);
        initialize_until(instance, 2.0);
        TEST_ASSERT_EQUAL_INT(STATUS_INVALID_TIME,
                              instance_do_step(instance, cases[i].t, cases[i].h));
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(last_text, cases[i].expected), last_text);
        TEST_ASSERT_EQUAL_DOUBLE(0.0, instance_time(instance));
        ASSERT_OK(instance_do_step(instance, 0.0, 0.1));
    }
}

/* ---- Life ----------------------------------------------------------------------------------- */

static void test_reset_gives_a_fresh_instance(void) {
    struct instance *fresh = create();
    double expected[2];
    double states[2];
    initialize(fresh, 0.0);
    run(fresh, 50, expected);

    ASSERT_OK(set(instance, OSCILLATOR_X, 7.0));
    ASSERT_OK(set(instance, OSCILLATOR_RELATIVE_TOLERANCE, 1e-3));
    initialize(instance, 10.0);
    ASSERT_OK(set(instance, OSCILLATOR_OMEGA, 9.0));
    ASSERT_OK(instance_do_step(instance, 10.0, 1.0));
    instance_reset(instance);
    initialize(instance, 0.0);
    run(instance, 50, states);
    TEST_ASSERT_EQUAL_MEMORY(expected, states, sizeof states);
    instance_destroy(fresh);
}

static void test_instances_do_not_disturb_each_other(void) {
    enum { COUNT = 20 };
    struct instance *many[COUNT];
    double expected[2];
    initialize(instance, 0.0);
    run(instance, 30, expected);

    for (int k = 0; k < COUNT; k++) {
        many[k] = create();
        initialize(many[k], 0.0);
    }
    for (int i = 0; i < 30; i++) {
        for (int k = 0; k < COUNT; k++) {
            ASSERT_OK(set(many[k], OSCILLATOR_U, sin((i / 3) * 0.1)));
            ASSERT_OK(instance_do_step(many[k], i * 0.01, 0.01));
        }
    }
    for (int k = 0; k < COUNT; k++) {
        TEST_ASSERT_EQUAL_DOUBLE(expected[0], get(many[k], OSCILLATOR_X));
        TEST_ASSERT_EQUAL_DOUBLE(expected[1], get(many[k], OSCILLATOR_V));
        instance_destroy(many[k]);
    }
}

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
    struct instance *created = NULL;
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
    ASSERT_OK(instance_create(&states_only, &last_text_sink, &created));
    ASSERT_OK(instance_get_nominals(created, nominals, 2));
    TEST_ASSERT_EQUAL_DOUBLE(5.0, nominals[0]);
    TEST_ASSERT_EQUAL_DOUBLE(6.0, nominals[1]);
    instance_destroy(created);
}

/* What was calculated before a reset does not show after it. */
static void test_calculated_values_follow_a_reset(void) {
    const double fresh = get(instance, OSCILLATOR_ENERGY);
    ASSERT_OK(set(instance, OSCILLATOR_X, 3.0));
    TEST_ASSERT_TRUE(get(instance, OSCILLATOR_ENERGY) > fresh);
    instance_reset(instance);
    TEST_ASSERT_TRUE(get(instance, OSCILLATOR_ENERGY) == fresh);
}

static void test_initialization_needs_an_experiment(void) {
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT, instance_enter_initialization(instance));
    TEST_ASSERT_NOT_NULL(strstr(last_text, "the experiment must be set up first"));
}

static void test_an_experiment_that_makes_no_sense_is_refused(void) {
    const struct instance_experiment cases[] = {
        {.start_time = NAN},
        {.start_time = INFINITY},
        {.start_time = 1.0, .stop_time_defined = true, .stop_time = 0.5},
        {.stop_time_defined = true, .stop_time = NAN},
        {.tolerance_defined = true, .tolerance = 0.0},
        {.tolerance_defined = true, .tolerance = -1e-6},
        {.tolerance_defined = true, .tolerance = NAN},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT,
                              instance_setup_experiment(instance, &cases[i]));
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(last_text, "is refused"), last_text);
    }
    const struct instance_experiment undefined = {.stop_time = NAN, .tolerance = NAN};
    ASSERT_OK(instance_setup_experiment(instance, &undefined));
}

static void test_parameters_must_go_together_at_initialization_and_at_a_step(void) {
    setup(instance, 0.0);
    ASSERT_OK(instance_enter_initialization(instance));
    ASSERT_OK(set(instance, OSCILLATOR_OMEGA, -1.0));
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_PARAMETERS, instance_exit_initialization(instance));
    TEST_ASSERT_EQUAL_STRING("omega = -1 is refused: it must be above 0", last_text);

    instance_reset(instance);
    initialize(instance, 0.0);
    ASSERT_OK(set(instance, OSCILLATOR_OMEGA, 0.0));
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_PARAMETERS, instance_do_step(instance, 0.0, 0.1));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, instance_time(instance));
}

/* ---- Values --------------------------------------------------------------------------------- */

static void test_the_parameter_wins_over_the_experiment_over_the_default(void) {
    const struct instance_experiment experiment = {.tolerance_defined = true, .tolerance = 1e-6};
    const double by_default = get(instance, OSCILLATOR_EFFECTIVE_TOLERANCE);
    TEST_ASSERT_TRUE(by_default > 0.0 && by_default <= 1e-8);

    ASSERT_OK(instance_setup_experiment(instance, &experiment));
    TEST_ASSERT_DOUBLE_WITHIN(1e-20, 1e2 * by_default,
                              get(instance, OSCILLATOR_EFFECTIVE_TOLERANCE));
    ASSERT_OK(set(instance, OSCILLATOR_RELATIVE_TOLERANCE, 1e-9));
    TEST_ASSERT_DOUBLE_WITHIN(1e-20, 1e-1 * by_default,
                              get(instance, OSCILLATOR_EFFECTIVE_TOLERANCE));

    // what cannot be kept is not promised
    ASSERT_OK(set(instance, OSCILLATOR_RELATIVE_TOLERANCE, 1e-300));
    TEST_ASSERT_TRUE(get(instance, OSCILLATOR_EFFECTIVE_TOLERANCE) >= 1e-15);
    ASSERT_OK(set(instance, OSCILLATOR_RELATIVE_TOLERANCE, 1e300));
    TEST_ASSERT_TRUE(get(instance, OSCILLATOR_EFFECTIVE_TOLERANCE) < 1.0);
}

static void test_outputs_follow_what_was_set_last(void) {
    initialize(instance, 0.0);
    TEST_ASSERT_EQUAL_DOUBLE(2.0, get(instance, OSCILLATOR_ENERGY));
    ASSERT_OK(set(instance, OSCILLATOR_OMEGA, 4.0));
    TEST_ASSERT_EQUAL_DOUBLE(8.0, get(instance, OSCILLATOR_ENERGY));
}

static void test_a_vector_is_set_as_a_whole_or_not_at_all(void) {
    const unsigned references[] = {OSCILLATOR_X, OSCILLATOR_OMEGA, 99};
    const double values[] = {3.0, 1e6, 1.0};
    TEST_ASSERT_EQUAL_INT(STATUS_OUT_OF_RANGE, instance_set_real(instance, references, 2, values));
    TEST_ASSERT_EQUAL_DOUBLE(1.0, get(instance, OSCILLATOR_X));

    const unsigned unknown_last[] = {OSCILLATOR_X, 99};
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT,
                          instance_set_real(instance, unknown_last, 2, values));
    TEST_ASSERT_EQUAL_DOUBLE(1.0, get(instance, OSCILLATOR_X));
    TEST_ASSERT_EQUAL_STRING("value reference 99 is unknown: Oscillator has no such variable",
                             last_text);
}

static void test_a_vector_is_read_as_a_whole_or_not_at_all(void) {
    const unsigned references[] = {OSCILLATOR_X, OSCILLATOR_STEPS};
    double values[] = {-7.0, -7.0};
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT,
                          instance_get_real(instance, references, 2, values));
    TEST_ASSERT_EQUAL_DOUBLE(-7.0, values[0]);
    TEST_ASSERT_EQUAL_STRING(
        "steps (value reference 80) is accessed as float64: it is of type int32", last_text);

    int integers[] = {-7, -7};
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT,
                          instance_get_integer(instance, references, 1, integers));
    TEST_ASSERT_EQUAL_INT(-7, integers[0]);
}

static void test_a_result_that_is_not_finite_is_not_given(void) {
    const unsigned reference = OSCILLATOR_ENERGY;
    double value = -7.0;
    ASSERT_OK(set(instance, OSCILLATOR_V, 1e200));
    initialize(instance, 0.0);
    TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE, instance_get_real(instance, &reference, 1, &value));
    TEST_ASSERT_EQUAL_DOUBLE(-7.0, value);
    TEST_ASSERT_NOT_NULL(strstr(last_text, "energy"));
    TEST_ASSERT_EQUAL_DOUBLE(1e200, get(instance, OSCILLATOR_V));
}

static void test_settings_are_closed_after_initialization(void) {
    const unsigned limit = OSCILLATOR_MAX_STEPS;
    const int value = 5;
    initialize(instance, 0.0);
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT,
                          instance_set_integer(instance, &limit, 1, &value));
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT, set(instance, OSCILLATOR_X, 2.0));
    TEST_ASSERT_NOT_NULL(strstr(last_text, "only inputs and tunable parameters can"));
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_ARGUMENT, set(instance, OSCILLATOR_GAIN, 2.0));
}

static void test_no_values_are_fine(void) {
    ASSERT_OK(instance_set_real(instance, NULL, 0, NULL));
    ASSERT_OK(instance_get_real(instance, NULL, 0, NULL));
    ASSERT_OK(instance_set_integer(instance, NULL, 0, NULL));
    ASSERT_OK(instance_get_integer(instance, NULL, 0, NULL));
    instance_destroy(NULL);
}
