/* Texts of message_write are the same on every platform. */
#include "last_text.h"

#include <math.h>
#include <stdint.h>
#include <string.h>
#include <unity.h>

static const char *written(const char *text) {
    message_write(&last_text_sink, STATUS_OK, "%s", text);
    return last_text;
}

/* Whatever the C library calls it. */
static void test_nan_of_printf(void) {
    for (unsigned sign = 0; sign < 2; sign++) {
        const uint64_t bits = 0x7ff8000000000000u | (uint64_t)sign << 63;
        double not_a_number = 0.0;
        memcpy(&not_a_number, &bits, sizeof bits);
        message_write(&last_text_sink, STATUS_OK, "(m1 = %g, m2 = %.17g)", not_a_number,
                      not_a_number);
        TEST_ASSERT_EQUAL_STRING("(m1 = nan, m2 = nan)", last_text);
    }
}

static void test_nan_has_one_name(void) {
    TEST_ASSERT_EQUAL_STRING("nan", written("nan"));
    TEST_ASSERT_EQUAL_STRING("nan", written("-nan"));
    TEST_ASSERT_EQUAL_STRING("a nan, nan)", written("a -nan(ind), nan(snan))"));
    TEST_ASSERT_EQUAL_STRING("(nan, nan) nan (m)", written("(nan(ind), -nan) -nan (m)"));
    TEST_ASSERT_EQUAL_STRING("nan(", written("-nan("));
}

static void test_other_words_stay(void) {
    static const char *const texts[] = {
        "",     "-",     "n",    "na",   "-na",          "banana",    "nano",
        "nan1", "nan_2", "4nan", "_nan", "inf and -inf", "tau1-nano", "-5 (ind)",
    };
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        TEST_ASSERT_EQUAL_STRING(texts[i], written(texts[i]));
    }
}

static void test_without_a_sink_nothing_is_written(void) {
    const struct message_sink none = {0};
    message_write(&last_text_sink, STATUS_OK, "before");
    message_write(&none, STATUS_OK, "%g", NAN);
    TEST_ASSERT_EQUAL_STRING("before", last_text);
}
