/* A message sink that keeps the last text, for the tests of src/. */
#ifndef LAST_TEXT_H
#define LAST_TEXT_H

#include "status.h"

extern char last_text[512];
extern const struct message_sink last_text_sink;

/* The status of a call; its text is shown where it is another one. */
#define ASSERT_STATUS(status, call) TEST_ASSERT_EQUAL_INT_MESSAGE(status, call, last_text)
#define ASSERT_OK(call)             ASSERT_STATUS(STATUS_OK, call)
#define ASSERT_REFUSED(call)        ASSERT_STATUS(STATUS_INVALID_ARGUMENT, call)

#endif
