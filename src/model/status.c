#include "status.h"

#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum severity status_severity(enum status status) {
    switch (status) {
#define STATUS_CASE(code, severity, text)                                                          \
    case code:                                                                                     \
        return severity;
        STATUS_LIST(STATUS_CASE) // NOLINT(bugprone-branch-clone): a row, a case
#undef STATUS_CASE
    }
    return SEVERITY_ERROR;
}

const char *status_text(enum status status) {
    switch (status) {
#define STATUS_CASE(code, severity, text)                                                          \
    case code:                                                                                     \
        return text;
        STATUS_LIST(STATUS_CASE)
#undef STATUS_CASE
    }
    return "unknown status";
}

/* ---- Messages ------------------------------------------------------------------------------- */

static bool is_in_word(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
}

/* Returns the length of the word nan in front of text, with the sign and the kind that some
 * platforms add; 0 if it is not there. */
static size_t nan_length(const char *text) {
    const size_t end = (size_t)(*text == '-') + strlen("nan");
    if (strncmp(text + (*text == '-'), "nan", strlen("nan")) != 0 || is_in_word(text[end])) {
        return 0;
    }
    const char *kind_end = text[end] == '(' ? strchr(text + end, ')') : NULL;
    return kind_end != NULL ? (size_t)(kind_end - text) + 1 : end;
}

/* Returns the length of the decimal fraction in front of text if it has more than 15 digits,
 * otherwise 0. */
static size_t long_fraction_length(const char *text) {
    const size_t whole = strspn(text, "0123456789");
    if (whole == 0 || text[whole] != '.') {
        return 0;
    }
    size_t length = whole + 1 + strspn(text + whole + 1, "0123456789");
    const size_t zeros = strspn(text, "0.");
    const bool is_long = length > zeros + 15;
    if (text[length] == 'e') {
        const size_t sign = text[length + 1] == '-' || text[length + 1] == '+';
        const size_t digits = strspn(text + length + 1 + sign, "0123456789");
        length += digits > 0 ? 1 + sign + digits : 0;
    }
    return is_long ? length : 0;
}

enum { SHORTER_SIZE = 32 };

/* Writes the number in front of text with the fewest digits that are read as the same double.
 * Returns its length in text, or 0 if there is no number or it cannot become shorter. */
static size_t shorten_number(const char *text, char shorter[SHORTER_SIZE]) {
    const size_t length = long_fraction_length(text);
    const double number = length > 0 ? strtod(text, NULL) : 0.0;
    for (int digits = 15; digits < 17 && length > 0; digits++) {
        (void)snprintf(shorter, SHORTER_SIZE, "%.*g", digits, number);
        if (strtod(shorter, NULL) == number) {
            return strlen(shorter) <= length ? length : 0;
        }
    }
    return 0;
}

/* Writes numbers alike on every platform: printf writes NaN as nan, -nan, nan(ind) or -nan(ind),
 * and 0.8 with %.17g as 0.80000000000000004. */
static void simplify_numbers(char *text) {
    char *to = text;
    const char *from = text;
    char last = ' '; // last character written
    while (*from != '\0') {
        char shorter[SHORTER_SIZE] = "nan";
        size_t length = is_in_word(last) ? 0 : nan_length(from);
        if (length == 0 && !is_in_word(last) && last != '.') {
            length = shorten_number(from, shorter);
        }
        if (length > 0) {
            memcpy(to, shorter, strlen(shorter));
            to += strlen(shorter);
            from += length;
        } else {
            *to++ = *from++;
        }
        last = to[-1];
    }
    *to = '\0';
}

void message_format(char *text, size_t size, const char *format, va_list arguments) {
    (void)vsnprintf(text, size, format, arguments);
    simplify_numbers(text);
}

void message_write(const struct message_sink *sink, enum status status, const char *format, ...) {
    if (sink->write == NULL) {
        return;
    }

    char text[1024];
    va_list arguments;
    va_start(arguments, format);
    message_format(text, sizeof text, format, arguments);
    va_end(arguments);
    sink->write(sink->context, status, text);
}
