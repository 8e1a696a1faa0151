/* Problems and claims as text: words and hexadecimal numbers, a line each. README.md has the
 * format. */
#ifndef TEXT_H
#define TEXT_H

#include "step.h"

#include <stdio.h>

enum { MESSAGE_LENGTH = 160 };

/* What is read before the first communication step. */
struct text_problem {
    struct arm_problem arm;
    double start; /* s */
    int sine_count[EFFORTS];
    struct sine sines[EFFORTS][SINES];
};

/* Reads up to the first `to`. False: `message` says what is wrong. */
bool text_read_problem(FILE *file, struct text_problem *problem, char message[MESSAGE_LENGTH]);

/* Reads a communication step: its end (s) and the efforts over it. False: at the end of the file,
 * where `message` is empty, or what is wrong. */
bool text_read_step(FILE *file, const struct text_problem *problem, double *end,
                    struct effort efforts[EFFORTS], char message[MESSAGE_LENGTH]);

/* Reads `count` finite numbers of no more than 2^100. */
bool text_read_numbers(FILE *file, double numbers[], int count);

void text_write_balls(FILE *file, const char *name, const struct ball balls[], int count);
void text_write_numbers(FILE *file, const char *name, const double numbers[], int count);

/* All that a step claims. */
void text_write_step(FILE *file, const struct arm_problem *problem, const struct arm_step *step);

#endif
