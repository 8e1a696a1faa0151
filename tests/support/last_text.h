/* A message sink that keeps the last text, for the tests of src/. */
#ifndef LAST_TEXT_H
#define LAST_TEXT_H

#include "message.h"

extern char last_text[512];
extern const struct message_sink last_text_sink;

/* Shows the text of the call that failed. */
#define ASSERT_OK(call) TEST_ASSERT_EQUAL_INT_MESSAGE(STATUS_OK, call, last_text)

#endif
