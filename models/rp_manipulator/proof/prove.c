/* Encloses the arm's motion: reads a problem from standard input, writes balls that contain the
 * states at all communication points, and what each step claims to a file, if one is named. */
#include "operations.h"
#include "step.h"

#include <string.h>

#define SHORTEST 0x1p-40 /* part of a communication step that a step is not shorter than */
enum { MOST_STEPS = 100000 /* within a communication step */ };

enum { DONE = 0, STOPPED = 1, WRONG_USE = 2 };

struct run {
    struct arm_problem problem;
    struct effort efforts[EFFORTS];
    double start; /* s */
    struct states_set set;
    double longest; /* s: the step to try next */
    FILE *certificate;
};

/* ---- Text ----------------------------------------------------------------------------------- */

static int wrong(const char *message) {
    fprintf(stderr, "%s\n", message);
    return WRONG_USE;
}

static bool read_name(const char *name, char word[WORD]) {
    return text_read_word(stdin, word) && strcmp(word, name) == 0;
}

/* Reads up to the first `to`, into `word`. False: not understood. */
static bool read_problem(struct run *run, char word[WORD]) {
    struct ball *variables = run->problem.variables;
    if (!read_name("start", word) || !text_read_numbers(stdin, &run->start, 1) ||
        !read_name("states", word) || !text_read_balls(stdin, variables, STATES) ||
        !read_name("parameters", word) || !text_read_balls(stdin, variables + STATES, PARAMETERS)) {
        return false;
    }
    while (read_name("sine", word)) {
        double sine[4];
        if (!text_read_numbers(stdin, sine, 4) || !(sine[0] == 0.0 || sine[0] == 1.0)) {
            return false;
        }
        struct effort *effort = &run->efforts[sine[0] == 1.0];
        if (effort->sine_count == SINES) {
            return false;
        }
        effort->sines[effort->sine_count++] = (struct sine){sine[1], sine[2], sine[3]};
    }
    return true;
}

/* Reads what follows `to`. */
static bool read_step(struct run *run, double *end) {
    bool read = text_read_numbers(stdin, end, 1);
    for (int i = 0; i < EFFORTS; i++) {
        read = read && text_read_numbers(stdin, run->efforts[i].derivatives, 4);
    }
    return read;
}

static void write_point(const struct run *run, double time) {
    struct ball hull[STATES];
    states_hull(&run->set, hull);
    printf("point %a", time);
    text_write_balls(stdout, "", hull, STATES);
}

/* All that a step claims. */
static void write_claims(FILE *file, int directions, const struct arm_step *step) {
    const struct ball times[] = {step->length, step->within, step->elapsed};
    fprintf(file, "step %d\n", step->order);
    text_write_balls(file, "times", times, 3);
    text_write_balls(file, "hull", step->hull, STATES);
    text_write_balls(file, "box", step->box, STATES);
    text_write_balls(file, "remainder", step->remainder, STATES);
    text_write_balls(file, "endpoint", step->endpoint, STATES);
    for (int i = 0; i < STATES; i++) {
        text_write_balls(file, "jacobian", step->jacobian[i], directions);
    }
    text_write_numbers(file, "deviation", &step->deviation, 1);
    text_write_balls(file, "centre", step->after.centre, STATES);
    for (int j = 0; j < step->after.sides; j++) {
        text_write_numbers(file, "side", step->after.side[j], STATES);
    }
    text_write_numbers(file, "radii", step->after.radius, STATES);
}

/* ---- Steps ---------------------------------------------------------------------------------- */

/* One step of at most `remaining`, as long as it can be. False: not even the shortest one goes. */
static bool step_on(struct run *run, struct ball remaining, struct arm_step *step) {
    for (bool done = false; !done;) {
        double factor;
        step->length = run->longest < remaining.hi ? ball_exact(run->longest) : remaining;
        done = arm_take_step(&run->problem, &run->set, run->efforts, step, &factor);
        const double next = step->length.hi * factor;
        run->longest = done && next < run->longest ? run->longest : next;
        if (!done && !(next >= SHORTEST * remaining.hi)) {
            return false;
        }
    }
    return true;
}

/* Not above from + within, and not below from. */
static double rounded_down(double from, struct ball within) {
    const struct ball time = ball_sum(ball_exact(from), within);
    const double below = time.hi - 0x1p-52 * fabs(time.hi);
    return below > from ? below : from;
}

/* All steps from one communication point to the next. False: the proof holds up to `reached`. */
static bool communication_step(struct run *run, double from, double to, double *reached) {
    static struct arm_step step; // too large for the stack of every system
    const struct ball since_start = ball_between(run->start, from);
    struct ball remaining = ball_between(from, to);
    struct ball within = ball_exact(0.0);
    bool last = false;
    for (int i = 0; !last; i++) {
        step.within = within;
        step.elapsed = ball_sum(since_start, within);
        if (i == MOST_STEPS || !step_on(run, remaining, &step)) {
            *reached = rounded_down(from, within);
            return false;
        }
        last = step.length.hi == remaining.hi;
        run->set = step.after;
        if (run->certificate != NULL) {
            write_claims(run->certificate, run->problem.directions, &step);
        }
        within = ball_sum(within, step.length);
        remaining = ball_difference(remaining, step.length);
    }
    return true;
}

static int enclose(struct run *run) {
    char word[WORD];
    if (!read_problem(run, word)) {
        return wrong("expected start, states, parameters and sines in finite numbers");
    }
    arm_start(&run->problem, &run->set);
    double from = run->start, to = from, reached;
    run->longest = INFINITY;
    write_point(run, from);
    for (; word[0] != '\0'; text_read_word(stdin, word)) {
        if (strcmp(word, "to") != 0 || !read_step(run, &to) || !(to > from)) {
            return wrong("expected 'to', a later time and finite efforts");
        }
        if (!communication_step(run, from, to, &reached)) {
            printf("stopped %a\n", reached);
            return STOPPED;
        }
        write_point(run, to);
        if (run->certificate != NULL) {
            fprintf(run->certificate, "point %a\n", to);
        }
        from = to;
    }
    return DONE;
}

int main(int count, char *arguments[]) {
    static struct run run;
    if (count == 2 && strcmp(arguments[1], "--operations") == 0) {
        return operations_answer(stdin, stdout) ? DONE : wrong("operation not understood");
    }
    if (count > 2) {
        return wrong("usage: prove [CERTIFICATE] < PROBLEM, or prove --operations");
    }
    if (count == 2 && (run.certificate = fopen(arguments[1], "w")) == NULL) {
        return wrong("the certificate cannot be written");
    }
    int result = enclose(&run);
    if (run.certificate != NULL && fclose(run.certificate) != 0) {
        result = wrong("the certificate cannot be written");
    }
    return result;
}
