#include "status.h"

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

static void test_a_long_message_is_cut_and_none_is_needed(void) {
    char longer[2000];
    memset(longer, 'x', sizeof longer - 1);
    longer[sizeof longer - 1] = '\0';
    const struct message_sink sink = {.write = receive, .context = received};
    message_write(&sink, STATUS_OK, "%s", longer);
    TEST_ASSERT_TRUE(strlen(received) > 100 && strlen(received) < sizeof longer - 1);

    const struct message_sink none = {0};
    message_write(&none, STATUS_OK, "%s", longer);
}
