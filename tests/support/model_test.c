#include "model_test.h"

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
