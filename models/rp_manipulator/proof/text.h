/* Numbers and balls as text, in hexadecimal. README.md has the formats. */
#ifndef TEXT_H
#define TEXT_H

#include "ball.h"

#include <stdio.h>
#include <stdlib.h>

enum { WORD = 64 };

/* False, and an empty word: the file ends. */
static inline bool text_read_word(FILE *file, char word[WORD]) {
    word[0] = '\0';
    return fscanf(file, "%63s", word) == 1;
}

/* Finite numbers of no more than 2^100. */
static inline bool text_read_numbers(FILE *file, double numbers[], int count) {
    char word[WORD];
    for (int i = 0; i < count; i++) {
        char *end = word;
        if (!text_read_word(file, word)) {
            return false;
        }
        numbers[i] = strtod(word, &end);
        if (*end != '\0' || !(fabs(numbers[i]) <= 0x1p100)) {
            return false;
        }
    }
    return true;
}

static inline bool text_read_balls(FILE *file, struct ball balls[], int count) {
    for (int i = 0; i < count; i++) {
        double parts[3];
        if (!text_read_numbers(file, parts, 3)) {
            return false;
        }
        balls[i] = (struct ball){parts[0], parts[1], parts[2]};
        if (!(fabs(balls[i].lo) <= HALF_ULP * fabs(balls[i].hi)) || balls[i].radius < 0.0) {
            return false;
        }
    }
    return true;
}

static inline void text_write_numbers(FILE *file, const char *name, const double numbers[],
                                      int count) {
    fprintf(file, "%s", name);
    for (int i = 0; i < count; i++) {
        fprintf(file, " %a", numbers[i]);
    }
    fprintf(file, "\n");
}

static inline void text_write_balls(FILE *file, const char *name, const struct ball balls[],
                                    int count) {
    fprintf(file, "%s", name);
    for (int i = 0; i < count; i++) {
        fprintf(file, " %a %a %a", balls[i].hi, balls[i].lo, balls[i].radius);
    }
    fprintf(file, "\n");
}

#endif
