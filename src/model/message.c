#include "message.h"

#include <stdarg.h>
#include <stdio.h>

void message_write(const struct message_sink *sink, enum status status, const char *format, ...) {
    if (sink->write == NULL) {
        return;
    }

    char text[512];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    sink->write(sink->context, status, text);
}
