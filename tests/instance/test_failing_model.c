/* A model that fails to compute its outputs or their derivatives for a while: each call reports it
 * and gives no value. Afterwards it works again. */
#include "derivatives.h"
#include "one_instance.h"
#include "oscillator_by_hand.h"

static struct model model;
static struct model_description model_description;
static bool has_outputs;
static int propagations_left; /* before one fails */
static bool is_infinite;      /* what propagations give */

static enum status outputs(void *values, double t) {
    return has_outputs ? oscillator_model.outputs(values, t) : STATUS_NOT_FINITE;
}

static enum status propagate(const void *values, double t, double dt, void *first, void *second) {
    if (propagations_left-- <= 0) {
        return STATUS_NOT_FINITE;
    }
    const enum status status = oscillator_model.propagate(values, t, dt, first, second);
    if (is_infinite) {
        ((struct oscillator_values *)first)->energy = INFINITY;
    }
    return status;
}

void setUp(void) {
    model = oscillator_model;
    model.outputs = outputs;
    model.propagate = propagate;
    model_description = oscillator_description;
    model_description.model = &model;
    has_outputs = true;
    propagations_left = 100;
    is_infinite = false;
    create(&model_description);
    initialize_at(0.0);
    ASSERT_OK(instance_do_step(instance, 0.0, 0.1));
    last_text[0] = '\0';
}

static const unsigned energy = OSCILLATOR_ENERGY;
static const unsigned x = OSCILLATOR_X;

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

/* Outputs that are valid already are not computed again, so an input is set first. */
static void without_outputs(void) {
    has_outputs = false;
    set(OSCILLATOR_U, 0.5);
}

static void test_without_outputs_nothing_is_read_or_derived(void) {
    without_outputs();
    assert_fails(read_energy, "no outputs at t = 0.1");
    assert_fails(derive_energy, "no outputs at t = 0.1");
    assert_fails(derive_energy_by_x, "no outputs at t = 0.1");
    has_outputs = true;
    assert_works(read_energy);
    assert_works(derive_energy);
    assert_works(derive_energy_by_x);
}

static void test_states_are_read_without_outputs(void) {
    without_outputs();
    TEST_ASSERT_TRUE(isfinite(get(OSCILLATOR_X)));
}

/* Along time the model propagates twice. */
static void test_derivatives_fail_with_any_propagation(void) {
    for (int good = 0; good < 2; good++) {
        propagations_left = good;
        assert_fails(derive_energy, "no derivatives at t = 0.1");
    }
    propagations_left = 0;
    assert_fails(derive_energy_by_x, "no derivatives at t = 0.1");
    propagations_left = 100;
    assert_works(derive_energy);
    assert_works(derive_energy_by_x);
}

static void test_a_derivative_that_is_not_finite_is_not_given(void) {
    is_infinite = true;
    assert_fails(derive_energy, "energy at t = 0.1");
    assert_fails(derive_energy_by_x, "energy by x at t = 0.1");
    is_infinite = false;
    assert_works(derive_energy);
    assert_works(derive_energy_by_x);
}
