/* Encloses the arm's motion: reads a problem from standard input, writes balls that contain the
 * states at all communication points, and what each step claims to a file, if one is named. */
#include "operations.h"
#include "text.h"

#include <string.h>

#define SHORTEST 0x1p-40 /* part of a communication step that a step is not shorter than */
enum { ATTEMPTS = 200, MOST_STEPS = 100000 /* within a communication step */ };

enum { DONE = 0, STOPPED = 1, WRONG_USE = 2 };

struct run {
    struct text_problem problem;
    struct states_set set;
    double longest; /* s: the step to try next */
    FILE *certificate;
};

static void write_point(const struct run *run, double time) {
    struct ball hull[STATES];
    states_hull(&run->problem.arm, &run->set, hull);
    printf("point %a", time);
    text_write_balls(stdout, "", hull, STATES);
}

/* One step of at most `remaining`, as long as it can be. False: not even the shortest one goes. */
static bool step_on(struct run *run, const struct effort efforts[EFFORTS], struct ball remaining,
                    struct arm_step *step) {
    const double shortest = SHORTEST * remaining.hi;
    for (int attempt = 0; attempt < ATTEMPTS; attempt++) {
        double factor;
        step->length = run->longest < remaining.hi ? ball_exact(run->longest) : remaining;
        const double length = step->length.hi;
        const enum arm_step_result result =
            arm_take_step(&run->problem.arm, &run->set, efforts, step, &factor);
        if (result == STEP_DONE) {
            run->longest = length * factor > run->longest ? length * factor : run->longest;
            return true;
        }
        run->longest = length * factor;
        if (!(run->longest >= shortest)) {
            return false;
        }
    }
    return false;
}

/* Not above from + within, and not below from. */
static double rounded_down(double from, struct ball within) {
    const struct ball time = ball_sum(ball_exact(from), within);
    const double below = time.hi - 0x1p-52 * fabs(time.hi);
    return below > from ? below : from;
}

/* All steps from one communication point to the next. False: the proof holds up to `reached`. */
static bool communication_step(struct run *run, double from, double to,
                               const struct effort efforts[EFFORTS], double *reached) {
    static struct arm_step step; // too large for the stack of every system
    const struct ball since_start = ball_between(run->problem.start, from);
    struct ball remaining = ball_between(from, to);
    struct ball within = ball_exact(0.0);
    bool last = false;
    for (int i = 0; !last; i++) {
        step.within = within;
        step.elapsed = ball_sum(since_start, within);
        if (i == MOST_STEPS || !step_on(run, efforts, remaining, &step)) {
            *reached = rounded_down(from, within);
            return false;
        }
        last = step.length.hi == remaining.hi;
        run->set = step.after;
        if (run->certificate != NULL) {
            text_write_step(run->certificate, &run->problem.arm, &step);
        }
        within = ball_sum(within, step.length);
        remaining = ball_difference(remaining, step.length);
    }
    return true;
}

static int wrong(const char *message) {
    fprintf(stderr, "%s\n", message);
    return WRONG_USE;
}

static int enclose(struct run *run) {
    char message[MESSAGE_LENGTH];
    struct effort efforts[EFFORTS];
    double to, reached;
    if (!text_read_problem(stdin, &run->problem, message)) {
        return wrong(message);
    }
    arm_start(&run->problem.arm, &run->set);
    double from = run->problem.start;
    run->longest = INFINITY;
    write_point(run, from);
    while (text_read_step(stdin, &run->problem, &to, efforts, message)) {
        if (!(to > from)) {
            return wrong("times do not increase");
        }
        if (!communication_step(run, from, to, efforts, &reached)) {
            printf("stopped %a\n", reached);
            return STOPPED;
        }
        write_point(run, to);
        if (run->certificate != NULL) {
            fprintf(run->certificate, "point %a\n", to);
        }
        from = to;
    }
    return message[0] == '\0' ? DONE : wrong(message);
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
