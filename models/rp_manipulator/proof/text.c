#include "text.h"

#include <stdlib.h>
#include <string.h>

enum { WORD = 64 };
#define LARGEST 0x1p100

/* ---- Reading -------------------------------------------------------------------------------- */

static bool read_word(FILE *file, char word[WORD]) {
    return fscanf(file, "%63s", word) == 1;
}

bool text_read_numbers(FILE *file, double numbers[], int count) {
    char word[WORD];
    for (int i = 0; i < count; i++) {
        char *end = word;
        if (!read_word(file, word)) {
            return false;
        }
        numbers[i] = strtod(word, &end);
        if (*end != '\0' || end == word || !(fabs(numbers[i]) <= LARGEST)) {
            return false;
        }
    }
    return true;
}

/* Values with their radii. */
static bool read_balls(FILE *file, struct ball balls[], int count) {
    for (int i = 0; i < count; i++) {
        double pair[2];
        if (!text_read_numbers(file, pair, 2) || pair[1] < 0.0) {
            return false;
        }
        balls[i] = ball_around(pair[0], pair[1]);
    }
    return true;
}

/* Of an effort by its index. */
static bool read_sine(FILE *file, struct text_problem *problem) {
    double numbers[4];
    if (!text_read_numbers(file, numbers, 4) || !(numbers[0] == 0.0 || numbers[0] == 1.0)) {
        return false;
    }
    const int effort = (int)numbers[0];
    if (problem->sine_count[effort] == SINES) {
        return false;
    }
    const struct sine sine = {numbers[1], numbers[2], numbers[3]};
    problem->sines[effort][problem->sine_count[effort]++] = sine;
    return true;
}

static bool fail(char message[MESSAGE_LENGTH], const char *what, const char *word) {
    snprintf(message, MESSAGE_LENGTH, "%s after '%s'", what, word);
    return false;
}

bool text_read_problem(FILE *file, struct text_problem *problem, char message[MESSAGE_LENGTH]) {
    char word[WORD] = "the begin";
    *problem = (struct text_problem){0};
    while (read_word(file, word)) {
        bool read = false;
        if (strcmp(word, "parameters") == 0) {
            read = read_balls(file, problem->arm.parameters, PARAMETERS);
        } else if (strcmp(word, "states") == 0) {
            read = read_balls(file, problem->arm.states, STATES);
        } else if (strcmp(word, "sine") == 0) {
            read = read_sine(file, problem);
        } else if (strcmp(word, "start") == 0) {
            return text_read_numbers(file, &problem->start, 1) || fail(message, "no number", word);
        }
        if (!read) {
            return fail(message, "no finite numbers", word);
        }
    }
    return fail(message, "no start", word);
}

bool text_read_step(FILE *file, const struct text_problem *problem, double *end,
                    struct effort efforts[EFFORTS], char message[MESSAGE_LENGTH]) {
    char word[WORD];
    message[0] = '\0';
    if (!read_word(file, word)) {
        return false;
    }
    if (strcmp(word, "to") != 0 || !text_read_numbers(file, end, 1)) {
        return fail(message, "no time", word);
    }
    for (int i = 0; i < EFFORTS; i++) {
        efforts[i] = (struct effort){.sine_count = problem->sine_count[i]};
        memcpy(efforts[i].sines, problem->sines[i], sizeof efforts[i].sines);
        if (!text_read_numbers(file, efforts[i].derivatives, 4)) {
            return fail(message, "no finite efforts", word);
        }
    }
    return true;
}

/* ---- Writing -------------------------------------------------------------------------------- */

void text_write_balls(FILE *file, const char *name, const struct ball balls[], int count) {
    fprintf(file, "%s", name);
    for (int i = 0; i < count; i++) {
        fprintf(file, " %a %a %a", balls[i].hi, balls[i].lo, balls[i].radius);
    }
    fprintf(file, "\n");
}

void text_write_numbers(FILE *file, const char *name, const double numbers[], int count) {
    fprintf(file, "%s", name);
    for (int i = 0; i < count; i++) {
        fprintf(file, " %a", numbers[i]);
    }
    fprintf(file, "\n");
}

void text_write_step(FILE *file, const struct arm_problem *problem, const struct arm_step *step) {
    const struct ball times[] = {step->length, step->within, step->elapsed};
    fprintf(file, "step %d\n", step->order);
    text_write_balls(file, "times", times, 3);
    text_write_balls(file, "hull", step->hull, STATES);
    text_write_balls(file, "box", step->box, STATES);
    text_write_balls(file, "remainder", step->remainder, STATES);
    text_write_balls(file, "endpoint", step->endpoint, STATES);
    for (int i = 0; i < STATES; i++) {
        text_write_balls(file, "jacobian", step->jacobian[i], STATES + problem->uncertain);
    }
    const struct states_set *after = &step->after;
    text_write_numbers(file, "deviation", &step->deviation, 1);
    text_write_balls(file, "centre", after->centre, STATES);
    for (int i = 0; i < STATES; i++) {
        text_write_numbers(file, "spread", after->spread[i], after->starts);
    }
    for (int i = 0; i < STATES; i++) {
        text_write_numbers(file, "frame", after->frame[i], STATES);
    }
    text_write_numbers(file, "radii", after->radii, STATES);
}
