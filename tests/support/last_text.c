#include "last_text.h"

#include <string.h>

char last_text[512];

static void keep(void *context, enum status status, const char *text) {
    strncpy(last_text, text, sizeof last_text - 1);
}

const struct message_sink last_text_sink = {.write = keep};
