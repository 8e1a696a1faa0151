/* What an instance checks when it is created; nominal and calculated values; derivatives along time
 * and by directions; a model that fails to compute them. */
#include "continuous_states.h"
#include "one_instance.h"
#include "oscillator.h"

void setUp(void) {
    create(&model_description);
    setup(instance, 0.0, INFINITY);
    ASSERT_OK(instance_enter_initialization(instance));
}

/* The texts of one call, one after the other. */
static char texts[1000];

static void collect(void *context, enum status status, const char *text) {
    (void)strncat(texts, text, sizeof texts - strlen(texts) - 1);
}

/* The first row is checked as all others: tests/wheel/test_wheel.c. */
static void test_a_wrong_field_in_the_first_row_is_refused(void) {
    struct variable variable = model_description.variables[1]; // omega, a parameter
    struct model_description wrong = model_description;
    struct instance *none = instance;
    variable.offset = offsetof(struct equations_values, v_energy);
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
    struct model_description states_only = model_description;
    struct instance *made = NULL;
    double nominals[2] = {0.0, 0.0};
    for (size_t i = 0, row = 0; i < model_description.variable_count; i++) {
        const struct variable *variable = &model_description.variables[i];
        if (variable->reference == OSCILLATOR_x || variable->reference == OSCILLATOR_v) {
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
    const double fresh = get(OSCILLATOR_energy);
    set(OSCILLATOR_x, 3.0);
    TEST_ASSERT_TRUE(get(OSCILLATOR_energy) > fresh);
    instance_reset(instance);
    TEST_ASSERT_TRUE(get(OSCILLATOR_energy) == fresh);
}

/* ---- Derivatives ---------------------------------------------------------------------------- */

static double derivative(unsigned reference, int order) {
    double value = NAN;
    ASSERT_OK(instance_get_output_derivatives(instance, &reference, 1, &order, &value));
    return value;
}

/* A value set after a step over which the input moved is held: its slope no longer counts. */
static void test_a_value_set_after_a_moving_step_has_no_slope(void) {
    const double w = 2.0;
    ASSERT_OK(instance_exit_initialization(instance));
    set_input_derivative(OSCILLATOR_u, 1, 3.0);
    ASSERT_OK(instance_do_step(instance, 0.0, 0.5, NULL));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -w * w * get(OSCILLATOR_v) + 3.0, derivative(OSCILLATOR_a, 1));
    set(OSCILLATOR_u, 0.25);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -w * w * get(OSCILLATOR_v), derivative(OSCILLATOR_a, 1));
}

/* Once anything of an input is set after a step over which it moved, outputs answer for the input
 * that the next step will have: the value set last with the new derivatives. */
static void test_new_derivatives_start_from_the_value_set_last(void) {
    ASSERT_OK(instance_exit_initialization(instance));
    set_input_derivative(OSCILLATOR_u, 1, 3.0);
    set_input_derivative(OSCILLATOR_u, 2, -8.0);
    ASSERT_OK(instance_do_step(instance, 0.0, 0.5, NULL));
    set_input_derivative(OSCILLATOR_u, 1, 5.0);
    const double x = get(OSCILLATOR_x);
    TEST_ASSERT_EQUAL_DOUBLE(-4.0 * x, get(OSCILLATOR_a));
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, -4.0 * get(OSCILLATOR_v) + 5.0, derivative(OSCILLATOR_a, 1));
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, -4.0 * get(OSCILLATOR_a), derivative(OSCILLATOR_a, 2));
}

static void test_knowns_and_unknowns_that_are_none_are_refused(void) {
    const unsigned x = OSCILLATOR_x;
    const unsigned omega = OSCILLATOR_omega;
    const unsigned energy = OSCILLATOR_energy;
    const unsigned setting = OSCILLATOR_effective_relative_tolerance;
    const double one = 1.0;
    double value = -7.0;
    ASSERT_OK(instance_get_directional_derivative(instance, KNOWN_MOTION, &x, 1, &omega, 1, &one,
                                                  &value));
    ASSERT_OK(instance_exit_initialization(instance));
    value = -7.0;
    const struct {
        const unsigned *unknown, *known;
    } cases[] = {{&x, &omega}, {&x, &energy}, {&omega, &x}, {&setting, &x}, {&x, &setting}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        ASSERT_REFUSED(instance_get_directional_derivative(instance, KNOWN_MOTION, cases[i].unknown,
                                                           1, cases[i].known, 1, &one, &value));
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(last_text, "is refused"), last_text);
    }
    TEST_ASSERT_EQUAL_DOUBLE(-7.0, value);
}

/* ---- A model that fails for a while ---------------------------------------------------------- */

/* Each call reports that outputs or derivatives fail, and gives no value. Afterwards it works
 * again. */

static struct model model;
static struct model_description altered_description;
static bool has_outputs;
static int evaluations_left; /* before one fails */
static bool is_infinite;     /* what derivatives are */

static enum status outputs(void *values, double t) {
    return has_outputs ? equations_model.outputs(values, t) : STATUS_NOT_FINITE;
}

static enum status derivatives(const void *values, double t, double dt, void *first, void *second) {
    if (evaluations_left-- <= 0) {
        return STATUS_NOT_FINITE;
    }
    const enum status status = equations_model.derivatives(values, t, dt, first, second);
    if (is_infinite) {
        ((struct equations_values *)first)->v_energy = INFINITY;
    }
    return status;
}

/* Steps an instance of the model once. */
static void begin_failing(void) {
    model = equations_model;
    model.outputs = outputs;
    model.derivatives = derivatives;
    altered_description = model_description;
    altered_description.model = &model;
    has_outputs = true;
    evaluations_left = 100;
    is_infinite = false;
    create(&altered_description);
    initialize_at(0.0);
    ASSERT_OK(instance_do_step(instance, 0.0, 0.1, NULL));
    last_text[0] = '\0';
}

static const unsigned energy = OSCILLATOR_energy;
static const unsigned x = OSCILLATOR_x;

static enum status read_energy(double *value) {
    return instance_get_real(instance, &energy, 1, value);
}

static enum status derive_energy(double *value) {
    const int order = 1;
    return instance_get_output_derivatives(instance, &energy, 1, &order, value);
}

static enum status derive_energy_by_x(double *value) {
    const double one = 1.0;
    return instance_get_directional_derivative(instance, KNOWN_MOTION, &energy, 1, &x, 1, &one,
                                               value);
}

static void assert_fails(enum status call(double *), const char *expected) {
    double value = -7.0;
    last_text[0] = '\0';
    TEST_ASSERT_EQUAL_INT(STATUS_NOT_FINITE, call(&value));
    TEST_ASSERT_TRUE(value == -7.0);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(last_text, expected), last_text);
}

static void assert_works(enum status call(double *)) {
    double value = NAN;
    ASSERT_OK(call(&value));
    TEST_ASSERT_TRUE(isfinite(value));
}

static void test_without_outputs_only_states_are_read(void) {
    begin_failing();
    has_outputs = false;
    set(OSCILLATOR_u, 0.5); // outputs that are valid already are not computed again
    assert_fails(read_energy, "no outputs at t = 0.1");
    assert_fails(derive_energy, "no outputs at t = 0.1");
    assert_fails(derive_energy_by_x, "no outputs at t = 0.1");
    TEST_ASSERT_TRUE(isfinite(get(OSCILLATOR_x))); // a state
    has_outputs = true;
    assert_works(read_energy);
    assert_works(derive_energy);
    assert_works(derive_energy_by_x);
}

/* Along time the model derives twice. */
static void test_derivatives_fail_with_any_evaluation(void) {
    begin_failing();
    for (int good = 0; good < 2; good++) {
        evaluations_left = good;
        assert_fails(derive_energy, "no derivatives at t = 0.1");
    }
    evaluations_left = 0;
    assert_fails(derive_energy_by_x, "no derivatives at t = 0.1");
    evaluations_left = 100;
    assert_works(derive_energy);
    assert_works(derive_energy_by_x);
}

static void test_a_derivative_that_is_not_finite_is_not_given(void) {
    begin_failing();
    is_infinite = true;
    assert_fails(derive_energy, "energy at t = 0.1");
    assert_fails(derive_energy_by_x, "energy by x at t = 0.1");
    is_infinite = false;
    assert_works(derive_energy);
    assert_works(derive_energy_by_x);
}
