/* Every status has a text and a severity; texts of messages are the same on every platform. */
#include "last_text.h"
#include "status.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#define LISTED(code, severity, text) code,
static const enum status all[] = {STATUS_LIST(LISTED)};
enum { COUNT = sizeof all / sizeof all[0] };

static void test_every_status_has_a_text_of_its_own(void) {
    for (int i = 0; i < COUNT; i++) {
        TEST_ASSERT_TRUE(strlen(status_text(all[i])) > 0);
        for (int j = 0; j < i; j++) {
            TEST_ASSERT_TRUE(strcmp(status_text(all[i]), status_text(all[j])) != 0);
        }
    }
}

static void test_only_ok_is_without_severity(void) {
    TEST_ASSERT_EQUAL_INT(0, STATUS_OK);
    for (int i = 0; i < COUNT; i++) {
        TEST_ASSERT_EQUAL_INT(all[i] == STATUS_OK, status_severity(all[i]) == SEVERITY_NONE);
    }
}

static void test_an_unknown_status_is_an_error(void) {
    TEST_ASSERT_EQUAL_INT(SEVERITY_ERROR, status_severity((enum status)COUNT));
    TEST_ASSERT_EQUAL_STRING("unknown status", status_text((enum status)COUNT));
}

/* ---- Messages ------------------------------------------------------------------------------- */

static char received[1024];
static enum status received_status;

static void receive(void *context, enum status status, const char *text) {
    TEST_ASSERT_EQUAL_PTR(received, context);
    received_status = status;
    strncpy(received, text, sizeof received - 1);
}

static void test_a_message_arrives_formatted(void) {
    const struct message_sink sink = {.write = receive, .context = received};
    message_write(&sink, STATUS_OUT_OF_RANGE, "%s = %g", "m1", -2.0);
    TEST_ASSERT_EQUAL_STRING("m1 = -2", received);
    TEST_ASSERT_EQUAL_INT(STATUS_OUT_OF_RANGE, received_status);
}

static void test_a_long_message_is_cut(void) {
    char longer[2000];
    memset(longer, 'x', sizeof longer - 1);
    longer[sizeof longer - 1] = '\0';
    const struct message_sink sink = {.write = receive, .context = received};
    message_write(&sink, STATUS_OK, "%s", longer);
    TEST_ASSERT_TRUE(strlen(received) > 100 && strlen(received) < sizeof longer - 1);
}

static const char *written(const char *text) {
    message_write(&last_text_sink, STATUS_OK, "%s", text);
    return last_text;
}

/* NaN has one name, whatever the C library calls it. */
static void test_nan_has_one_name(void) {
    TEST_ASSERT_EQUAL_STRING("nan", written("nan"));
    TEST_ASSERT_EQUAL_STRING("nan", written("-nan"));
    TEST_ASSERT_EQUAL_STRING("a nan, nan)", written("a -nan(ind), nan(snan))"));
    TEST_ASSERT_EQUAL_STRING("(nan, nan) nan (m)", written("(nan(ind), -nan) -nan (m)"));
    TEST_ASSERT_EQUAL_STRING("nan(", written("-nan("));
    for (int sign = -1; sign < 2; sign += 2) {
        const double not_a_number = copysign(NAN, sign);
        message_write(&last_text_sink, STATUS_OK, "(m1 = %g, m2 = %.17g)", not_a_number,
                      not_a_number);
        TEST_ASSERT_EQUAL_STRING("(m1 = nan, m2 = nan)", last_text);
    }
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

static void test_names_and_whole_numbers_stay(void) {
    static const char *const texts[] = {"v0.80000000000000004", "1.2.80000000000000004", "0.", "1e",
                                        "18014398509481984",    "1234567890123450.0"};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        TEST_ASSERT_EQUAL_STRING(texts[i], written(texts[i]));
    }
}

/* As few digits as are read as the same double, of doubles of all sizes. */
static void test_numbers_are_short_and_exact(void) {
    message_write(&last_text_sink, STATUS_OK, "a = %.17g is above b = %.17g, %.17g", 0.8, 0.1 + 0.2,
                  -1e22);
    TEST_ASSERT_EQUAL_STRING("a = 0.8 is above b = 0.30000000000000004, -1e+22", last_text);
    uint64_t bits = 1;
    for (int i = 0; i < 10000; i++) {
        bits = bits * 6364136223846793005u + 1442695040888963407u;
        double number = 0.0;
        memcpy(&number, &bits, sizeof bits);
        /* every second one has few digits */
        number = i % 2 == 0 ? number : (double)(bits >> 44) / 1e3;
        if (!isfinite(number)) {
            continue;
        }
        message_write(&last_text_sink, STATUS_OK, "%.17g", number);
        TEST_ASSERT_TRUE(strtod(last_text, NULL) == number);
        char shorter[32];
        (void)snprintf(shorter, sizeof shorter, "%.15g", number);
        if (strtod(shorter, NULL) == number) {
            TEST_ASSERT_LESS_OR_EQUAL_size_t(strlen(shorter), strlen(last_text));
        }
    }
}

static void test_without_a_sink_nothing_is_written(void) {
    const struct message_sink none = {0};
    message_write(&last_text_sink, STATUS_OK, "before");
    message_write(&none, STATUS_OK, "%g", NAN);
    TEST_ASSERT_EQUAL_STRING("before", last_text);
}
