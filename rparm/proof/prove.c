/* Encloses the motion of a model: reads model and problem from standard input, writes balls that
 * contain states and outputs at all communication points, and what each step claims to a file, if
 * one is named. */
#include "step.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SHORTEST 0x1p-40 /* a step over what remains of a communication step, at least, */
#define AHEAD    0x1p-32 /* and how far ahead the reason is looked for */
enum { MOST_ATTEMPTS = 200000 /* within a communication step */, MOST_NODES = 1 << 20, WORD = 64 };
enum { DONE = 0, STOPPED = 1, WRONG_USE = 2 };

static const char *const OPERATIONS[] = {
    "number", "state", "input", "time", "+", "-", "*", "/", "negative", NULL,
};
static const char *const OBSTACLES[] = {"none", "growth", "event", "undefined"};

static int wrong(const char *message) {
    fprintf(stderr, "%s\n", message);
    return WRONG_USE;
}

/* ---- The problem ----------------------------------------------------------------------------- */

/* False, and an empty word: the input ends. */
static bool read_word(char word[WORD]) {
    word[0] = '\0';
    return scanf("%63s", word) == 1;
}

static bool read_name(const char *name, char word[WORD]) {
    return read_word(word) && strcmp(word, name) == 0;
}

/* Finite numbers of no more than 2^1000. */
static bool read_number(double *number) {
    char word[WORD], *end = word;
    const bool read = read_word(word);
    *number = strtod(word, &end);
    return read && *end == '\0' && end != word && fabs(*number) <= 0x1p1000;
}

/* Numbers of nodes and the like, below a limit. */
static bool read_counts(int counts[], int count, int limit) {
    bool read = true;
    for (int i = 0; i < count && read; i++) {
        double number = 0.0;
        read = read_number(&number) && number >= 0.0 && number < limit;
        counts[i] = read ? (int)number : 0;
    }
    return read;
}

/* A node; its arguments are before it. */
static bool read_node(struct model *model, int i) {
    struct node *node = model->nodes + i;
    char word[WORD];
    int operation = 0, arguments[2] = {0};
    read_word(word);
    while (operation < CALL && strcmp(word, OPERATIONS[operation]) != 0) {
        operation++;
    }
    *node = (struct node){.operation = (enum operation)operation, .second = -1, .slope = NO_NODE};
    bool read = true;
    if (operation == NUMBER) {
        return read_number(&node->number.hi);
    }
    if (operation == CALL) {
        for (size_t f = 0; f < sizeof(FUNCTIONS) / sizeof(FUNCTIONS[0]); f++) {
            node->function =
                strcmp(word, FUNCTIONS[f].name) == 0 ? FUNCTIONS[f].of : node->function;
        }
        // its slope may come later; what is no part of the series is its own slope
        read = node->function != NULL && read_counts(arguments, 1, i) &&
               read_counts(&node->slope, 1, model->count);
    } else if (operation >= SUM) {
        read = read_counts(arguments, operation == NEGATIVE ? 1 : 2, i);
    } else if (operation != TIME) {
        read = read_counts(arguments, 1, operation == STATE ? model->states : model->inputs);
    }
    node->first = arguments[0];
    node->second = operation >= SUM && operation < NEGATIVE ? arguments[1] : -1;
    node->moves = operation == STATE || operation == TIME ||
                  (operation >= SUM && (model->nodes[node->first].moves ||
                                        (node->second >= 0 && model->nodes[node->second].moves)));
    return read;
}

static bool series_create(struct series *series, const struct model *model, int directions) {
    const size_t count = (size_t)model->count;
    series->model = model;
    series->rows = calloc((1 + (size_t)directions) * count * ORDERS, sizeof(struct ball));
    series->paces = calloc(count * ORDERS, sizeof(struct ball));
    series->reciprocals = calloc(count, sizeof(struct ball));
    return series->rows != NULL && series->paces != NULL && series->reciprocals != NULL;
}

/* Reads the model; `starts` are the nodes of the states' starts. */
static bool read_model(struct prover *prover, int starts[]) {
    struct model *model = &prover->model;
    char word[WORD];
    int sizes[7];
    bool read = read_name("model", word) && read_counts(sizes, 7, MOST_NODES);
    if (!read || sizes[3] < 1 || sizes[3] > MOST_STATES || sizes[0] < sizes[3] ||
        sizes[1] > sizes[2] || sizes[2] > sizes[0]) {
        return false;
    }
    *model = (struct model){.count = sizes[0],
                            .of_rates = sizes[1],
                            .of_series = sizes[2],
                            .states = sizes[3],
                            .inputs = sizes[4],
                            .outputs = sizes[5],
                            .guards = sizes[6]};
    model->nodes = calloc((size_t)model->count, sizeof(struct node));
    model->output = calloc((size_t)model->outputs + 1, sizeof(int));
    model->guard = calloc((size_t)model->guards + 1, sizeof(int));
    model->positive = calloc((size_t)model->guards + 1, sizeof(bool));
    model->input = calloc((size_t)model->inputs + 1, sizeof(struct ball));
    read = model->nodes != NULL && model->output != NULL && model->guard != NULL &&
           model->positive != NULL && model->input != NULL &&
           series_create(&prover->centre, model, 0) &&
           series_create(&prover->hull, model, model->states);
    for (int i = 0; i < model->count && read; i++) {
        read = read_node(model, i);
    }
    read = read && read_name("rates", word) &&
           read_counts(model->rate, model->states, model->of_rates) && read_name("outputs", word) &&
           read_counts(model->output, model->outputs, model->count) && read_name("guards", word) &&
           read_counts(model->guard, model->guards, model->of_series);
    for (int i = 0; i < model->guards && read; i++) {
        int positive = 0;
        read = read_counts(&positive, 1, 2);
        model->positive[i] = positive == 1;
    }
    for (int k = 1; k < ORDERS; k++) {
        prover->per_order[k] = ball_quotient(ONE, ball_exact(k));
    }
    return read && read_name("starts", word) && read_counts(starts, model->states, model->count);
}

/* ---- The answer ------------------------------------------------------------------------------ */

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

/* The states and outputs at a time, with the inputs as they are. */
static void write_point(struct prover *prover, const struct states_set *set, double time) {
    const struct model *model = &prover->model;
    struct ball values[MOST_STATES];
    set_hull(set, model->states, values);
    series_values(&prover->centre, values, ball_exact(time), model->count);
    printf("point %a", time);
    for (int i = 0; i < model->outputs; i++) {
        struct ball x = *series_row(&prover->centre, 0, model->output[i]);
        x = i < model->states ? x : ball_widened(x, x.radius * LOOSENED);
        printf(" %a %a %a", x.hi, x.lo, x.radius);
    }
    printf("\n");
}

/* All that a step claims; the last one of a communication step ends with that. */
static void write_claims(FILE *file, int n, const struct step *step, bool is_last) {
    fprintf(file, "step %d %a\n", step->order, is_last ? 0.0 : step->length.hi);
    write_balls(file, "box", step->box, n);
    write_balls(file, "centre", step->after.centre, n);
    for (int j = 0; j < step->after.sides; j++) {
        write_numbers(file, "side", step->after.side[j], n);
    }
    write_numbers(file, "radii", step->after.radius, step->after.sides);
}

/* ---- Steps ----------------------------------------------------------------------------------- */

/* Where states grow: looks for a node without bounds a little ahead, which may be why. */
static void find_undefined(struct prover *prover, const struct states_set *set, double ahead) {
    struct step *step = &prover->step;
    const struct model *model = &prover->model;
    struct ball states[MOST_STATES];
    set_hull(set, model->states, states);
    series_values(&prover->centre, states, step->begin, model->of_series);
    for (int i = 0; i < model->states; i++) {
        const struct ball rate = *series_row(&prover->centre, 0, model->rate[i]);
        states[i] = ball_widened(states[i], ball_largest(rate) * ahead);
    }
    const struct ball times = ball_widened(step->begin, ahead);
    const int unbounded = series_values(&prover->centre, states, times, model->of_series);
    if (unbounded != NO_NODE) {
        step->obstacle = UNDEFINED;
        step->where = unbounded;
    }
}

/* All steps from one communication point to the next; `longest`: the step in s to try next. Returns
 * up to when the proof holds. */
static double communication_step(struct prover *prover, struct states_set *set, double *longest,
                                 double from, double to, FILE *certificate) {
    struct step *step = &prover->step;
    struct ball within = ball_exact(0.0), remaining = ball_of_sum(to, -from);
    for (int attempt = 0; attempt < MOST_ATTEMPTS; attempt++) {
        const bool is_last = !(*longest < remaining.hi);
        step->length = is_last ? remaining : ball_exact(*longest);
        step->begin = ball_sum(ball_exact(from), within);
        const bool done = take_step(prover, set);
        const double next = step->length.hi * step->factor;
        *longest = done && next < *longest ? *longest : next;
        if (!done) {
            attempt = next >= SHORTEST * remaining.hi ? attempt : MOST_ATTEMPTS;
            continue;
        }
        *set = step->after;
        if (certificate != NULL) {
            write_claims(certificate, prover->model.states, step, is_last);
        }
        if (is_last) {
            return to;
        }
        within = ball_sum(within, step->length);
        remaining = ball_difference(remaining, step->length);
    }
    if (step->obstacle == GROWTH) {
        find_undefined(prover, set, AHEAD * remaining.hi);
    }
    // rounded down
    const struct ball time = ball_sum(ball_exact(from), within);
    const double below = time.hi - 0x1p-52 * fabs(time.hi);
    return below > from ? below : from;
}

static int enclose(struct prover *prover, FILE *certificate) {
    static struct states_set set; // too large for the stack of every system
    struct model *model = &prover->model;
    struct ball start[MOST_STATES] = {{0}};
    char word[WORD];
    int starts[MOST_STATES];
    double from = 0.0, to = 0.0, longest = INFINITY;
    bool read = read_model(prover, starts) && read_name("start", word) && read_number(&from);
    double radii[MOST_STATES] = {0};
    if (read) {
        series_values(&prover->centre, start, ball_exact(from), model->count);
    }
    for (int i = 0; i < model->states && read; i++) {
        read = read_number(&radii[i]) && radii[i] >= 0.0;
        start[i] = *series_row(&prover->centre, 0, starts[i]);
    }
    if (!read || !read_word(word)) {
        return wrong("expected a model of up to 64 states, and their starts in numbers");
    }
    set_start(&set, start, radii, model->states);
    for (bool is_first = true; is_first || read_word(word); is_first = false) {
        read = strcmp(word, "to") == 0 && read_number(&to) && to > from;
        for (int i = 0; i < model->inputs && read; i++) {
            read = read_number(&model->input[i].hi);
        }
        if (!read) {
            return wrong("expected 'to', a later time and inputs");
        }
        if (is_first) {
            write_point(prover, &set, from);
        }
        const double reached = communication_step(prover, &set, &longest, from, to, certificate);
        if (reached < to) {
            const struct step *step = &prover->step;
            printf("stopped %a %s %d\n", reached, OBSTACLES[step->obstacle], step->where);
            return STOPPED;
        }
        write_point(prover, &set, to);
        if (certificate != NULL) {
            fprintf(certificate, "point %a\n", to);
        }
        from = to;
    }
    return DONE;
}

int main(int count, char *arguments[]) {
    static struct prover prover; // too large for the stack of every system
    FILE *certificate = NULL;
    if (count > 2) {
        return wrong("usage: prove [CERTIFICATE] < PROBLEM");
    }
    if (count == 2 && (certificate = fopen(arguments[1], "w")) == NULL) {
        return wrong("the certificate cannot be written");
    }
    const int result = enclose(&prover, certificate);
    bool written = fflush(stdout) == 0 && ferror(stdout) == 0;
    if (certificate != NULL) {
        written = fflush(certificate) == 0 && ferror(certificate) == 0 && written;
        written = fclose(certificate) == 0 && written;
    }
    return written ? result : wrong("what is proven cannot be written");
}
