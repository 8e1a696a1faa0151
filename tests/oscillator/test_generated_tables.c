/* The table that fmu/generate.py makes from oscillator/variables.toml is the one written by hand.
 */
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
        TEST_ASSERT_EQUAL_UINT64(expected->offset, row->offset);
        TEST_ASSERT_EQUAL_INT(expected->causality, row->causality);
        TEST_ASSERT_EQUAL_INT(expected->variability, row->variability);
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
    TEST_ASSERT_EQUAL_PTR(&oscillator_model, model_description.model);
    TEST_ASSERT_EQUAL_INT(OSCILLATOR_ENERGY, OSCILLATOR_energy);
    TEST_ASSERT_EQUAL_STRING("energy", variable_find(&model_description, OSCILLATOR_energy)->name);
    TEST_ASSERT_TRUE(model_description.default_tolerance == 1e-8);
}
