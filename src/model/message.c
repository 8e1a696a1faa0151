#include "message.h"

#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

static bool is_in_word(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
}

/* The word nan in front of text, with the sign and the kind that some platforms give it; 0 if there
 * is none. */
static size_t nan_length(const char *text) {
    const size_t end = (size_t)(*text == '-') + strlen("nan");
    if (strncmp(text + (*text == '-'), "nan", strlen("nan")) != 0 || is_in_word(text[end])) {
        return 0;
    }
    const char *kind_end = text[end] == '(' ? strchr(text + end, ')') : NULL;
    return kind_end != NULL ? (size_t)(kind_end - text) + 1 : end;
}

/* printf writes NaN as nan, -nan, nan(ind) or -nan(ind), which depends on the platform: all become
 * nan. */
static void write_nan_alike(char *text) {
    char *to = text;
    const char *from = text;
    bool after_word = false;
    while (*from != '\0') {
        const size_t length = after_word ? 0 : nan_length(from);
        if (length > 0) {
            memcpy(to, "nan", strlen("nan"));
            to += strlen("nan");
            from += length;
        } else {
            *to++ = *from++;
        }
        after_word = is_in_word(to[-1]);
    }
    *to = '\0';
}

void message_write(const struct message_sink *sink, enum status status, const char *format, ...) {
    if (sink->write == NULL) {
        return;
    }

    char text[512];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    write_nan_alike(text);
    sink->write(sink->context, status, text);
}
