/* Where the texts of an instance go: one function that the owner of the instance supplies. */
#ifndef MESSAGE_H
#define MESSAGE_H

#include "platform.h"
#include "status.h"

/* text: finished, one line, valid during the call only. */
typedef void message_function(void *context, enum status status, const char *text);

struct message_sink {
    message_function *write; /* NULL: texts are dropped */
    void *context;
};

PRINTF_FORMAT(3, 4)
void message_write(const struct message_sink *sink, enum status status, const char *format, ...);

#endif
