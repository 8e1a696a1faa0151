#include "model_test.h"

#include <string.h>
#include <unity.h>

void model_test_accepted(const struct model *model, const void *values) {
    char text[512] = "";
    TEST_ASSERT_EQUAL_INT_MESSAGE(STATUS_OK, model->check_parameters(values, text, sizeof text),
                                  text);
    TEST_ASSERT_EQUAL_STRING("", text);
}

void model_test_refused(const struct model *model, const void *values, const char *expected) {
    char text[512] = "";
    TEST_ASSERT_EQUAL_INT(STATUS_INVALID_PARAMETERS,
                          model->check_parameters(values, text, sizeof text));
    TEST_ASSERT_EQUAL_STRING(expected, text);
}

enum { LARGEST = 2048 }; /* bytes of a value structure */

void model_test_calculated_fields(const struct model *model, const void *values, const void *first,
                                  const void *second, size_t calculated) {
    enum { VALUES, FIRST, SECOND, ALONE, COUNT };
    const void *const given[COUNT] = {values, first, second, first};
    _Alignas(max_align_t) char clean[COUNT][LARGEST];
    _Alignas(max_align_t) char poisoned[COUNT][LARGEST];
    const size_t size = model->values_size;
    TEST_ASSERT_LESS_OR_EQUAL_size_t(LARGEST, size);
    for (int k = 0; k < COUNT; k++) {
        memcpy(clean[k], given[k], size);
        memcpy(poisoned[k], given[k], size);
        memset(poisoned[k] + calculated, 0xff, size - calculated); // NaN
    }
    TEST_ASSERT_EQUAL_INT(STATUS_OK,
                          model->propagate(clean[VALUES], 0.0, 0.0, clean[FIRST], clean[SECOND]));
    TEST_ASSERT_EQUAL_INT(
        STATUS_OK, model->propagate(poisoned[VALUES], 0.0, 0.0, poisoned[FIRST], poisoned[SECOND]));
    TEST_ASSERT_EQUAL_INT(STATUS_OK,
                          model->propagate(poisoned[VALUES], 0.0, 0.0, poisoned[ALONE], NULL));
    TEST_ASSERT_EQUAL_MEMORY(clean[FIRST], poisoned[FIRST], size);
    TEST_ASSERT_EQUAL_MEMORY(clean[SECOND], poisoned[SECOND], size);
    TEST_ASSERT_EQUAL_MEMORY(clean[FIRST], poisoned[ALONE], size);
}
