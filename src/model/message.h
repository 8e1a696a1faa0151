/* Where the texts of an instance go: one function that the owner of the instance supplies. */
#ifndef MESSAGE_H
#define MESSAGE_H

#include "platform.h"
#include "status.h"

#include <stdarg.h>
#include <stddef.h>

/* text: finished, one line, valid during the call only. */
typedef void message_function(void *context, enum status status, const char *text);

struct message_sink {
    message_function *write; /* NULL: texts are dropped */
    void *context;
};

/* vsnprintf, with numbers that look the same on every platform and have no more digits than needed:
 * %.17g writes 0.8 and 0.30000000000000004. */
PRINTF_FORMAT(3, 0)
void message_format(char *text, size_t size, const char *format, va_list arguments);

PRINTF_FORMAT(3, 4)
void message_write(const struct message_sink *sink, enum status status, const char *format, ...);

#endif
