/* Encloses the arm's motion: reads a problem from standard input, writes balls that contain states
 * and outputs at all communication points, and what each step claims to a file, if one is named. */
#include "arm_outputs.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SHORTEST 0x1p-40 /* a step over what remains of a communication step, at least */
enum { MOST_ATTEMPTS = 200000 /* within a communication step */, OPERANDS = 80, WORD = 64 };
enum { DONE = 0, STOPPED = 1, WRONG_USE = 2 };

struct run {
    struct arm_problem problem;
    struct states_set set;
    double longest; /* s: the step to try next */
    struct arm_step step;
};

static int wrong(const char *message) {
    fprintf(stderr, "%s\n", message);
    return WRONG_USE;
}

/* False, and an empty word: the input ends. */
static bool read_word(char word[WORD]) {
    word[0] = '\0';
    return scanf("%63s", word) == 1;
}

static bool read_name(const char *name, char word[WORD]) {
    return read_word(word) && strcmp(word, name) == 0;
}

/* Finite numbers of no more than 2^100. */
static bool read_numbers(double numbers[], int count) {
    bool read = true;
    for (int i = 0; i < count && read; i++) {
        char word[WORD], *end = word;
        read = read_word(word);
        numbers[i] = strtod(word, &end);
        read = read && *end == '\0' && fabs(numbers[i]) <= 0x1p100;
    }
    return read;
}

static bool read_balls(struct ball balls[], int count) {
    bool read = true;
    for (int i = 0; i < count && read; i++) {
        double x[3] = {0};
        read = read_numbers(x, 3) && fabs(x[1]) <= HALF_ULP * fabs(x[0]) && x[2] >= 0.0;
        balls[i] = (struct ball){x[0], x[1], x[2]};
    }
    return read;
}

/* Reads up to the first `to`, into `word`. False: not understood. */
static bool read_problem(struct arm_problem *problem, char word[WORD]) {
    struct ball *variables = problem->variables;
    bool read = read_name("start", word) && read_numbers(&problem->start, 1) &&
                read_name("states", word) && read_balls(variables, STATES) &&
                read_name("parameters", word) && read_balls(variables + STATES, PARAMETERS);
    while (read && read_name("sine", word)) {
        const int i = problem->sine_count++;
        double *sine = problem->sines[i];
        read = i < SINES && read_numbers(sine, 4) && (sine[0] == 0.0 || sine[0] == 1.0);
    }
    return read;
}

static void write_numbers(FILE *file, const char *name, const double numbers[], int count) {
    fprintf(file, "%s", name);
    for (int i = 0; i < count; i++) {
        fprintf(file, " %a", numbers[i]);
    }
    fprintf(file, "\n");
}

static void write_balls(FILE *file, const char *name, const struct ball balls[], int count) {
    fprintf(file, "%s", name);
    for (int i = 0; i < count; i++) {
        fprintf(file, " %a %a %a", balls[i].hi, balls[i].lo, balls[i].radius);
    }
    fprintf(file, "\n");
}

/* The states and outputs at `time`, which is `from` or the end of the step that begins there. */
static void write_point(const struct run *run, double from, double time) {
    struct ball values[STATES + OUTPUTS], efforts[EFFORTS];
    states_hull(&run->set, values);
    arm_efforts_at(&run->problem, from, ball_of_sum(time, -from), efforts);
    arm_outputs(&run->problem, values, efforts, values + STATES);
    printf("point %a", time);
    write_balls(stdout, "", values, STATES + OUTPUTS);
}

/* All that a step claims. */
static void write_claims(FILE *file, int directions, const struct arm_step *step) {
    const struct ball when[] = {step->times.length, step->times.within, step->times.elapsed};
    fprintf(file, "step %d\n", step->order);
    write_balls(file, "times", when, 3);
    write_balls(file, "hull", step->hull, STATES);
    write_balls(file, "box", step->box, STATES);
    write_balls(file, "remainder", step->remainder, STATES);
    write_balls(file, "endpoint", step->endpoint, STATES);
    for (int i = 0; i < STATES; i++) {
        write_balls(file, "jacobian", step->jacobian[i], directions);
    }
    write_numbers(file, "deviation", &step->deviation, 1);
    write_balls(file, "centre", step->after.centre, STATES);
    for (int j = 0; j < step->after.sides; j++) {
        write_numbers(file, "side", step->after.side[j], STATES);
    }
    write_numbers(file, "radii", step->after.radius, STATES);
}

/* Results of all operations on the same balls, so that another program can check each by itself. */
static int answer_operations(void) {
    double count;
    while (read_numbers(&count, 1)) {
        struct ball x[OPERANDS] = {{0}}, z[13] = {{0}};
        if (!(count >= 2.0 && count <= (double)OPERANDS) || !read_balls(x, (int)count)) {
            return wrong("expected 2 to 80, and as many balls");
        }
        const int half = (int)count / 2;
        z[0] = ball_sum(x[0], x[1]);
        z[1] = ball_difference(x[0], x[1]);
        z[2] = ball_product(x[0], x[1]);
        z[3] = ball_quotient(x[0], x[1]);
        z[4] = ball_convolution(x, x + half, half - 1);
        z[5] = ball_widened(x[0], x[1].hi);
        z[6] = ball_scaled(x[0], x[1].hi);
        z[7] = ball_of_sum(x[0].hi, x[1].hi);
        z[8] = ball_around(ball_smallest(x[0]), ball_largest(x[0]));
        ball_sine_and_cosine(x[0], z + 9, z + 10);
        ball_sine_and_versine(x[0], z + 11, z + 12);
        write_balls(stdout, "results", z, 13);
    }
    return feof(stdin) ? DONE : wrong("expected numbers");
}

/* All steps from one communication point to the next. Returns up to when the proof holds. */
static double communication_step(struct run *run, double from, double to, FILE *certificate) {
    struct arm_step *step = &run->step;
    struct ball within = ball_exact(0.0), remaining = ball_of_sum(to, -from);
    const struct ball since_start = ball_of_sum(from, -run->problem.start);
    for (int attempt = 0; attempt < MOST_ATTEMPTS; attempt++) {
        const bool last = !(run->longest < remaining.hi);
        step->times.length = last ? remaining : ball_exact(run->longest);
        step->times.within = within;
        step->times.elapsed = ball_sum(since_start, within);
        const bool done = arm_take_step(&run->problem, &run->set, step);
        const double next = step->times.length.hi * step->factor;
        run->longest = done && next < run->longest ? run->longest : next;
        if (!done) {
            attempt = next >= SHORTEST * remaining.hi ? attempt : MOST_ATTEMPTS;
            continue;
        }
        run->set = step->after;
        if (certificate != NULL) {
            write_claims(certificate, run->problem.directions, step);
        }
        if (last) {
            return to;
        }
        within = ball_sum(within, step->times.length);
        remaining = ball_difference(remaining, step->times.length);
    }
    // rounded down
    const struct ball time = ball_sum(ball_exact(from), within);
    const double below = time.hi - 0x1p-52 * fabs(time.hi);
    return below > from ? below : from;
}

static int enclose(struct run *run, FILE *certificate) {
    char word[WORD];
    if (!read_problem(&run->problem, word)) {
        return wrong("expected start, states, parameters and sines in numbers up to 1.2e30");
    }
    arm_start(&run->problem, &run->set);
    run->longest = INFINITY;
    const double start = run->problem.start;
    double from = start, to = from;
    do {
        bool read = strcmp(word, "to") == 0 && read_numbers(&to, 1) && to > from;
        for (int i = 0; i < EFFORTS; i++) {
            read = read && read_numbers(run->problem.cubic[i], 4);
        }
        if (!read) {
            return wrong("expected 'to', a later time and efforts up to 1.2e30");
        }
        if (from == start) {
            write_point(run, start, start);
        }
        const double reached = communication_step(run, from, to, certificate);
        if (reached < to) {
            printf("stopped %a\n", reached);
            return STOPPED;
        }
        write_point(run, from, to);
        if (certificate != NULL) {
            fprintf(certificate, "point %a\n", to);
        }
        from = to;
    } while (read_word(word));
    return DONE;
}

int main(int count, char *arguments[]) {
    static struct run run; // too large for the stack of every system
    FILE *certificate = NULL;
    if (count == 2 && strcmp(arguments[1], "--operations") == 0) {
        return answer_operations();
    }
    if (count > 2) {
        return wrong("usage: prove [CERTIFICATE] < PROBLEM, or prove --operations");
    }
    if (count == 2 && (certificate = fopen(arguments[1], "w")) == NULL) {
        return wrong("the certificate cannot be written");
    }
    const int result = enclose(&run, certificate);
    bool written = fflush(stdout) == 0 && ferror(stdout) == 0;
    if (certificate != NULL) {
        written = fflush(certificate) == 0 && ferror(certificate) == 0 && written;
        written = fclose(certificate) == 0 && written;
    }
    return written ? result : wrong("what is proven cannot be written");
}
