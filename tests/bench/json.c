#include "json.h"

#include "measure.h"

#include <math.h>

static void put_string(FILE *file, const char *text) {
    fputc('"', file);
    for (const char *c = text; *c != '\0'; c++) {
        if (*c == '"' || *c == '\\') {
            fputc('\\', file);
        }
        fputc((unsigned char)*c < ' ' ? ' ' : *c, file);
    }
    fputc('"', file);
}

/* Comma, line break and name. False where nothing is written. */
static bool begin_value(struct json *json, const char *name) {
    if (json->file == NULL) {
        return false;
    }
    fputs(json->first ? "\n" : ",\n", json->file);
    json->first = false;
    if (name != NULL) {
        put_string(json->file, name);
        fputs(": ", json->file);
    }
    return true;
}

void json_begin(struct json *json, const char *name, char bracket) {
    if (begin_value(json, name)) {
        fputc(bracket, json->file);
        json->first = true;
    }
}

void json_end(struct json *json, char bracket) {
    if (json->file != NULL) {
        fprintf(json->file, "\n%c", bracket);
        json->first = false;
    }
}

void json_text(struct json *json, const char *name, const char *text) {
    if (begin_value(json, name)) {
        put_string(json->file, text);
    }
}

void json_number(struct json *json, const char *name, double value) {
    require(isfinite(value), "a figure is not finite");
    if (begin_value(json, name)) {
        fprintf(json->file, "%.17g", value);
    }
}

void json_truth(struct json *json, const char *name, bool value) {
    if (begin_value(json, name)) {
        fputs(value ? "true" : "false", json->file);
    }
}
