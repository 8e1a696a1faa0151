/* Single operations on given operands, so that another program can check each by itself. */
#include "operations.h"

#include <string.h>

enum { OPERANDS = 80 };

/* False: there is no such operation. */
static bool apply(const char *name, const struct ball *x, int count, struct ball answer[2]) {
    if (strcmp(name, "sum") == 0) {
        answer[0] = ball_sum(x[0], x[1]);
    } else if (strcmp(name, "difference") == 0) {
        answer[0] = ball_difference(x[0], x[1]);
    } else if (strcmp(name, "product") == 0) {
        answer[0] = ball_product(x[0], x[1]);
    } else if (strcmp(name, "quotient") == 0) {
        answer[0] = ball_quotient(x[0], x[1]);
    } else if (strcmp(name, "convolution") == 0) {
        answer[0] = ball_convolution(x, x + count / 2, count / 2 - 1);
    } else if (strcmp(name, "widened") == 0) {
        answer[0] = ball_widened(x[0], x[1].hi);
    } else if (strcmp(name, "scaled") == 0) {
        answer[0] = ball_scaled(x[0], x[1].hi);
    } else if (strcmp(name, "between") == 0) {
        answer[0] = ball_between(x[0].hi, x[1].hi);
    } else if (strcmp(name, "bounds") == 0) {
        answer[0] = ball_around(ball_smallest(x[0]), ball_largest(x[0]));
    } else if (strcmp(name, "sine") == 0) {
        ball_sine_and_cosine(x[0], &answer[0], &answer[1]);
    } else if (strcmp(name, "versine") == 0) {
        ball_sine_and_versine(x[0], &answer[0], &answer[1]);
    } else {
        return false;
    }
    return true;
}

bool operations_answer(FILE *questions, FILE *answers) {
    char name[WORD];
    while (text_read_word(questions, name)) {
        struct ball operands[OPERANDS] = {{0}}, answer[2] = {{0}};
        double count;
        if (!text_read_numbers(questions, &count, 1) ||
            !(count >= 0.0 && count <= (double)OPERANDS) ||
            !text_read_balls(questions, operands, (int)count) ||
            !apply(name, operands, (int)count, answer)) {
            return false;
        }
        text_write_balls(answers, name, answer, 2);
    }
    return true;
}
