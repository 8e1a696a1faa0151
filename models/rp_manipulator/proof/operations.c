#include "operations.h"

#include "frame.h"
#include "text.h"

#include <string.h>

enum { WORD = 64, TERMS = 40 };

static bool read_balls(FILE *file, struct ball balls[], int count) {
    for (int i = 0; i < count; i++) {
        double parts[3];
        if (!text_read_numbers(file, parts, 3)) {
            return false;
        }
        balls[i] = (struct ball){parts[0], parts[1], parts[2]};
    }
    return true;
}

static bool answer_pair(const char *name, FILE *questions, struct ball *answer) {
    struct ball x[2];
    if (!read_balls(questions, x, 2)) {
        return false;
    }
    if (strcmp(name, "sum") == 0) {
        *answer = ball_sum(x[0], x[1]);
    } else if (strcmp(name, "difference") == 0) {
        *answer = ball_difference(x[0], x[1]);
    } else if (strcmp(name, "product") == 0) {
        *answer = ball_product(x[0], x[1]);
    } else if (strcmp(name, "quotient") == 0) {
        *answer = ball_quotient(x[0], x[1]);
    } else if (strcmp(name, "widened") == 0) {
        *answer = ball_widened(x[0], x[1].hi);
    } else if (strcmp(name, "scaled") == 0) {
        *answer = ball_scaled(x[0], x[1].hi);
    } else if (strcmp(name, "between") == 0) {
        *answer = ball_between(x[0].hi, x[1].hi);
    } else if (strcmp(name, "bounds") == 0) {
        *answer = (struct ball){ball_smallest(x[0]), 0.0, ball_largest(x[0])};
    } else {
        return false;
    }
    return true;
}

/* n, then n + 1 balls x and as many y */
static bool answer_convolution(FILE *questions, FILE *answers) {
    struct ball x[TERMS], y[TERMS];
    double given;
    if (!text_read_numbers(questions, &given, 1)) {
        return false;
    }
    const int n = given >= 0.0 && given <= 1e3 ? (int)given : TERMS;
    if (n >= TERMS || !read_balls(questions, x, n + 1) || !read_balls(questions, y, n + 1)) {
        return false;
    }
    const struct ball sum = ball_convolution(x, y, n);
    text_write_balls(answers, "convolution", &sum, 1);
    return true;
}

static bool answer_sine(FILE *questions, FILE *answers, bool versine) {
    struct ball x, both[2];
    if (!read_balls(questions, &x, 1)) {
        return false;
    }
    if (versine) {
        ball_sine_and_versine(ball_midpoint(x), &both[0], &both[1]);
    } else {
        ball_sine_and_cosine(x, &both[0], &both[1]);
    }
    text_write_balls(answers, "sine", both, 2);
    return true;
}

/* within, elapsed, step; four derivatives; amplitude, frequency, phase */
static bool answer_effort(FILE *questions, FILE *answers) {
    struct ball times[3], series[ORDERS];
    struct effort effort = {.sine_count = 1};
    double sine[3];
    if (!read_balls(questions, times, 3) || !text_read_numbers(questions, effort.derivatives, 4) ||
        !text_read_numbers(questions, sine, 3)) {
        return false;
    }
    effort.sines[0] = (struct sine){sine[0], sine[1], sine[2]};
    effort_series(&effort, times[0], times[1], times[2], LAST_ORDER, series);
    text_write_balls(answers, "effort", series, ORDERS);
    return true;
}

/* A frame of 4 x 4 numbers, 4 x 4 balls, 4 sizes and 4 rests; answers with the deviation and
 * coordinates. */
static bool answer_frame(FILE *questions, FILE *answers) {
    double frame[STATES][STATES], sizes[STATES], rest[STATES], results[1 + STATES];
    struct ball columns[STATES][STATES];
    if (!text_read_numbers(questions, frame[0], STATES * STATES) ||
        !read_balls(questions, columns[0], STATES * STATES) ||
        !text_read_numbers(questions, sizes, STATES) ||
        !text_read_numbers(questions, rest, STATES)) {
        return false;
    }
    results[0] = frame_coordinates(frame, columns, sizes, rest, results + 1);
    text_write_numbers(answers, "frame", results, 1 + STATES);
    return true;
}

bool operations_answer(FILE *questions, FILE *answers) {
    char name[WORD];
    while (fscanf(questions, "%63s", name) == 1) {
        struct ball answer;
        bool answered;
        if (strcmp(name, "convolution") == 0) {
            answered = answer_convolution(questions, answers);
        } else if (strcmp(name, "sine") == 0) {
            answered = answer_sine(questions, answers, false);
        } else if (strcmp(name, "versine") == 0) {
            answered = answer_sine(questions, answers, true);
        } else if (strcmp(name, "effort") == 0) {
            answered = answer_effort(questions, answers);
        } else if (strcmp(name, "frame") == 0) {
            answered = answer_frame(questions, answers);
        } else if ((answered = answer_pair(name, questions, &answer))) {
            text_write_balls(answers, name, &answer, 1);
        }
        if (!answered) {
            return false;
        }
    }
    return true;
}
