/* A JSON file, written as it comes. */
#ifndef BENCH_JSON_H
#define BENCH_JSON_H

#include <stdbool.h>
#include <stdio.h>

struct json {
    FILE *file; /* NULL: nothing is written */
    bool first; /* in the object or array that is open */
};

/* name: NULL inside an array. Names and texts are escaped; numbers must be finite. */
void json_begin(struct json *json, const char *name, char bracket);
void json_end(struct json *json, char bracket);
void json_text(struct json *json, const char *name, const char *text);
void json_number(struct json *json, const char *name, double value);
void json_truth(struct json *json, const char *name, bool value);

#endif
