/* What is generated from oscillator.toml is what is written by hand: table of variables, values,
 * derivatives and Taylor series. */
#include "equations.h"
#include "model_description.h"
#include "oscillator_by_hand.h"
#include "value_references.h"

#include <string.h>
#include <unity.h>

static void test_rows_are_those_written_by_hand(void) {
    for (size_t i = 0; i < oscillator_description.variable_count; i++) {
        const struct variable *expected = &oscillator_description.variables[i];
        const struct variable *row = variable_find(&model_description, expected->reference);
        TEST_ASSERT_NOT_NULL(row);
        TEST_ASSERT_EQUAL_INT(expected->type, row->type);
        TEST_ASSERT_EQUAL_INT(expected->owner, row->owner);
        TEST_ASSERT_EQUAL_INT(expected->causality, row->causality);
        // parameters of such files are tunable
        const bool is_fixed = expected->reference == OSCILLATOR_GAIN;
        TEST_ASSERT_EQUAL_INT(is_fixed ? VARIABILITY_TUNABLE : expected->variability,
                              row->variability);
        TEST_ASSERT_EQUAL_INT(expected->initial, row->initial);
        TEST_ASSERT_TRUE(expected->start == row->start && expected->min == row->min &&
                         expected->max == row->max && expected->nominal == row->nominal);
    }
}

static void test_every_row_is_found_by_its_reference(void) {
    for (size_t i = 0; i < model_description.variable_count; i++) {
        TEST_ASSERT_EQUAL_PTR(
            &model_description.variables[i],
            variable_find(&model_description, model_description.variables[i].reference));
    }
    TEST_ASSERT_NULL(variable_find(&model_description, model_description.reference_count));
}

static void test_names_and_references_of_the_header(void) {
    TEST_ASSERT_EQUAL_STRING("Oscillator", model_description.name);
    TEST_ASSERT_EQUAL_STRING(OSCILLATOR_NAME, model_description.name);
    TEST_ASSERT_EQUAL_STRING(OSCILLATOR_GUID, model_description.guid);
    TEST_ASSERT_EQUAL_PTR(&equations_model, model_description.model);
    TEST_ASSERT_EQUAL_INT(OSCILLATOR_ENERGY, OSCILLATOR_energy);
    TEST_ASSERT_EQUAL_STRING("energy", variable_find(&model_description, OSCILLATOR_energy)->name);
    TEST_ASSERT_TRUE(model_description.default_tolerance == 1e-8);
}

/* ---- Values --------------------------------------------------------------------------------- */

static const struct oscillator_values by_hand = {
    .omega = 1.75, .gain = 0.3, .u = -2.1, .x = 0.7, .v = 1.1};

static struct equations_values generated_of(const struct oscillator_values *from) {
    return (struct equations_values){
        .v_omega = from->omega,
        .v_gain = from->gain,
        .v_u = from->u,
        .v_x = from->x,
        .v_v = from->v,
    };
}

static void test_rates_and_jacobian_have_the_same_bits(void) {
    const struct equations_values generated = generated_of(&by_hand);
    const double x[] = {by_hand.x, by_hand.v};
    double found[2][4] = {{0.0}};
    double expected[2][4] = {{0.0}};
    equations_model.right_hand_side(&generated, 0.0, x, &by_hand.u, found[0]);
    equations_model.jacobian(&generated, 0.0, x, &by_hand.u, found[1]);
    oscillator_model.right_hand_side(&by_hand, 0.0, x, &by_hand.u, expected[0]);
    oscillator_model.jacobian(&by_hand, 0.0, x, &by_hand.u, expected[1]);
    for (int i = 0; i < 8; i++) {
        TEST_ASSERT_TRUE(found[i / 4][i % 4] == expected[i / 4][i % 4]);
    }
}

static void test_outputs_and_their_derivatives_are_the_same(void) {
    struct oscillator_values expected[3] = {by_hand, {.u = 0.4, .x = 1.1, .v = -0.6}, {.x = 0.2}};
    struct equations_values found[3];
    for (int i = 0; i < 3; i++) {
        found[i] = generated_of(&expected[i]);
    }
    TEST_ASSERT_EQUAL_INT(STATUS_OK, oscillator_model.outputs(&expected[0], 0.0));
    TEST_ASSERT_EQUAL_INT(STATUS_OK, equations_model.outputs(&found[0], 0.0));
    oscillator_model.propagate(&expected[0], 0.0, 1.0, &expected[1], &expected[2]);
    equations_model.propagate(&found[0], 0.0, 1.0, &found[1], &found[2]);
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-14, expected[i].a, found[i].v_a);
        TEST_ASSERT_DOUBLE_WITHIN(1e-14, expected[i].energy, found[i].v_energy);
    }
}

static void test_series_are_the_same(void) {
    const struct equations_values generated = generated_of(&by_hand);
    const double inputs[1][SERIES_INPUT_LENGTH] = {{by_hand.u, 0.5, -0.25}};
    struct series_origin origin = {.values = &by_hand, .time_scale = 0.5, .inputs = inputs};
    double expected[8][SERIES_LENGTH] = {{by_hand.x}, {by_hand.v}};
    double found[8][SERIES_LENGTH] = {{by_hand.x}, {by_hand.v}};
    TEST_ASSERT_TRUE(equations_model.series->row_count <= 8);
    oscillator_model.series->extend(&origin, 0, SERIES_LENGTH - 1, expected);
    origin.values = &generated;
    equations_model.series->extend(&origin, 0, SERIES_LENGTH - 1, found);
    for (int k = 0; k < SERIES_LENGTH; k++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-15, expected[0][k], found[0][k]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-15, expected[1][k], found[1][k]);
    }
}
