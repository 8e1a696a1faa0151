#include "toy.h"

#include <math.h>
#include <string.h>

/* A model whose first parameter, input and first state are these fields. */
#define MODEL(toy, parameter, input, state)                                                        \
    {                                                                                              \
        .values_size = sizeof(struct toy##_values),                                                \
        .parameters = {offsetof(struct toy##_values, parameter), sizeof(double[3])},               \
        .inputs = {offsetof(struct toy##_values, input), sizeof(double)},                          \
        .states = {offsetof(struct toy##_values, state), sizeof(double[2])},                       \
        .dx = {offsetof(struct toy##_values, v), sizeof(double[2])}, .right_hand_side = toy##_rhs, \
        .jacobian = jacobian, .series = &toy##_series, .outputs = toy##_outputs,                   \
        .check_parameters = no_check, .events = &toy##_events,                                     \
    }

/* ---- Ball ----------------------------------------------------------------------------------- */

static enum status ball_rhs(const void *values, double t, const double x[], const double u[],
                            double dx[]) {
    const struct ball_values *ball = values;
    dx[0] = ball->is_resting ? 0.0 : x[1];
    dx[1] = ball->is_resting ? 0.0 : u[0] - ball->g;
    return STATUS_OK;
}

/* Both models are two integrals: x' = v, v' = a. */
static enum status jacobian(const void *values, double t, const double x[], const double u[],
                            double J[]) {
    memset(J, 0, 4 * sizeof *J);
    J[2] = 1.0;
    return STATUS_OK;
}

static void extend_motion(const struct series_origin *origin, int k, double a,
                          double rows[][SERIES_LENGTH]) {
    rows[0][k] = origin->time_scale / k * rows[1][k - 1];
    rows[1][k] = origin->time_scale / k * a;
}

static double input_order(const struct series_origin *origin, int k) {
    return k < SERIES_INPUT_LENGTH ? origin->inputs[0][k] : 0.0;
}

static enum status ball_extend(const struct series_origin *origin, int first, int last,
                               double rows[][SERIES_LENGTH]) {
    const struct ball_values *ball = origin->values;
    for (int k = first > 0 ? first : 1; k <= last; k++) {
        const double pull = k == 1 ? ball->g : 0.0;
        extend_motion(origin, k, ball->is_resting ? 0.0 : input_order(origin, k - 1) - pull, rows);
    }
    return STATUS_OK;
}

static const struct series ball_series = {.row_count = 2, .extend = ball_extend};

static enum status ball_outputs(void *values, double t) {
    struct ball_values *ball = values;
    ball->a = ball->is_resting ? 0.0 : ball->lift - ball->g;
    return STATUS_OK;
}

static enum status no_check(const void *values, char *text, size_t size) {
    return STATUS_OK;
}

static bool ball_has_floor(const void *values) {
    return ((const struct ball_values *)values)->has_floor != 0.0;
}

static bool ball_is_resting(const void *values) {
    return ((const struct ball_values *)values)->is_resting;
}

/* It rests on the floor. */
static bool ball_mode_is_possible(const void *values, bool is_held) {
    const struct ball_values *ball = values;
    const bool can_rest = !is_held || (ball_has_floor(values) && ball->h == 0.0 && ball->v == 0.0);
    return ball->is_resting == 0 || (ball->is_resting == 1 && can_rest);
}

enum { BALL_HEIGHT, BALL_LOAD };

static void ball_describe(const void *values, struct indicator indicators[]) {
    const bool is_resting = ball_is_resting(values);
    indicators[BALL_HEIGHT] = (struct indicator){
        .kind = is_resting ? INDICATOR_UNUSED : INDICATOR_OF_STATE,
        .state = 0,
        .factor = 1.0,
        .rises = ((const struct ball_values *)values)->v > 0.0,
    };
    indicators[BALL_LOAD] =
        (struct indicator){.kind = is_resting ? INDICATOR_OF_MODEL : INDICATOR_UNUSED};
}

static enum status ball_indicators(const void *values, double t, const double x[], const double u[],
                                   double z[]) {
    const struct ball_values *ball = values;
    z[BALL_HEIGHT] = ball->is_resting ? 1.0 : x[0];
    z[BALL_LOAD] = ball->is_resting ? ball->g - u[0] : 1.0;
    return STATUS_OK;
}

static enum status ball_update(void *values, const struct event *event) {
    struct ball_values *ball = values;
    if (!ball_has_floor(values)) {
        ball->is_resting = 0;
        return STATUS_OK;
    }
    const bool hits = event->triggered != NULL ? event->triggered[BALL_HEIGHT] : ball->h <= 0.0;
    const double pull = ball->g - ball->lift;
    if (hits && !ball->is_resting) {
        ball->h = 0.0;
        if (ball->v <= 0.0) {
            ball->impulse -= (1.0 + ball->restitution) * ball->v;
            ball->v *= -ball->restitution;
            if (ball->v * ball->v <= 2.0 * pull * event->tolerance[0]) {
                ball->v = 0.0;
                ball->is_resting = 1;
            }
        }
    }
    if (ball->is_resting && pull <= 0.0) {
        ball->is_resting = pull == 0.0 && event->du[0] <= 0.0;
    }
    return STATUS_OK;
}

static const char *const ball_names[] = {"the height", "the load"};

static const struct model_events ball_events = {
    .indicator_count = 2,
    .indicator_names = ball_names,
    .modes = {offsetof(struct ball_values, is_resting), sizeof(int)},
    .discrete_states = {offsetof(struct ball_values, impulse), sizeof(double)},
    .are_possible = ball_has_floor,
    .modes_are_possible = ball_mode_is_possible,
    .is_at_rest = ball_is_resting,
    .describe = ball_describe,
    .indicators = ball_indicators,
    .update = ball_update,
};

static const struct model ball_model = MODEL(ball, g, lift, h);

/* ---- Block ---------------------------------------------------------------------------------- */

static double block_acceleration(const struct block_values *block, double f) {
    return block->direction == 0 ? 0.0 : (f - block->direction * block->coulomb) / block->m;
}

static enum status block_rhs(const void *values, double t, const double x[], const double u[],
                             double dx[]) {
    const struct block_values *block = values;
    dx[0] = block->direction == 0 ? 0.0 : x[1];
    dx[1] = block_acceleration(block, u[0]);
    return STATUS_OK;
}

static enum status block_extend(const struct series_origin *origin, int first, int last,
                                double rows[][SERIES_LENGTH]) {
    const struct block_values *block = origin->values;
    for (int k = first > 0 ? first : 1; k <= last; k++) {
        const double friction = k == 1 ? block->direction * block->coulomb : 0.0;
        const double force = block->direction == 0 ? 0.0 : input_order(origin, k - 1) - friction;
        extend_motion(origin, k, force / block->m, rows);
    }
    return STATUS_OK;
}

static const struct series block_series = {.row_count = 2, .extend = block_extend};

static enum status block_outputs(void *values, double t) {
    struct block_values *block = values;
    block->a = block_acceleration(block, block->f);
    return STATUS_OK;
}

static bool block_always(const void *values) {
    return true;
}

static bool block_sticks(const void *values) {
    return ((const struct block_values *)values)->direction == 0;
}

static bool block_mode_is_possible(const void *values, bool is_held) {
    const struct block_values *block = values;
    const bool exists = block->direction >= -1 && block->direction <= 1;
    return exists && (!is_held || block->direction * block->v > 0.0 || block->v == 0.0);
}

enum { BLOCK_SPEED, BLOCK_FORWARD, BLOCK_BACKWARD };

static void block_describe(const void *values, struct indicator indicators[]) {
    const struct block_values *block = values;
    const bool sticks = block_sticks(values);
    const struct indicator force = {.kind = sticks ? INDICATOR_OF_MODEL : INDICATOR_UNUSED};
    indicators[BLOCK_SPEED] = (struct indicator){
        .kind = sticks ? INDICATOR_UNUSED : INDICATOR_OF_STATE,
        .state = 1,
        .factor = block->direction,
    };
    indicators[BLOCK_FORWARD] = force;
    indicators[BLOCK_BACKWARD] = force;
}

static enum status block_indicators(const void *values, double t, const double x[],
                                    const double u[], double z[]) {
    const struct block_values *block = values;
    z[BLOCK_SPEED] = block->direction == 0 ? 1.0 : block->direction * x[1];
    z[BLOCK_FORWARD] = block->direction == 0 ? block->breakaway - u[0] : 1.0;
    z[BLOCK_BACKWARD] = block->direction == 0 ? block->breakaway + u[0] : 1.0;
    return STATUS_OK;
}

static enum status block_update(void *values, const struct event *event) {
    struct block_values *block = values;
    if (event->triggered != NULL && event->triggered[BLOCK_SPEED]) {
        block->v = 0.0;
    }
    if (block->v != 0.0) {
        block->direction = block->v > 0.0 ? 1 : -1;
        return STATUS_OK;
    }
    const bool rises = event->du[0] > 0.0;
    const bool falls = event->du[0] < 0.0;
    const bool forward = event->triggered != NULL && event->triggered[BLOCK_FORWARD] && !falls;
    const bool backward = event->triggered != NULL && event->triggered[BLOCK_BACKWARD] && !rises;
    block->direction = forward || block->f > block->breakaway     ? 1
                       : backward || block->f < -block->breakaway ? -1
                                                                  : 0;
    return STATUS_OK;
}

static const char *const block_names[] = {"the speed", "the force forward", "the force backward"};

static const struct model_events block_events = {
    .indicator_count = 3,
    .indicator_names = block_names,
    .modes = {offsetof(struct block_values, direction), sizeof(int)},
    .are_possible = block_always,
    .modes_are_possible = block_mode_is_possible,
    .is_at_rest = block_sticks,
    .describe = block_describe,
    .indicators = block_indicators,
    .update = block_update,
};

static const struct model block_model = MODEL(block, m, f, x);

/* ---- Hammer --------------------------------------------------------------------------------- */

static enum status hammer_rhs(const void *values, double t, const double x[], const double u[],
                              double dx[]) {
    dx[0] = x[1];
    dx[1] = u[0];
    return STATUS_OK;
}

static enum status hammer_extend(const struct series_origin *origin, int first, int last,
                                 double rows[][SERIES_LENGTH]) {
    for (int k = first > 0 ? first : 1; k <= last; k++) {
        extend_motion(origin, k, input_order(origin, k - 1), rows);
    }
    return STATUS_OK;
}

static const struct series hammer_series = {.row_count = 2, .extend = hammer_extend};

static enum status hammer_outputs(void *values, double t) {
    struct hammer_values *hammer = values;
    hammer->a = hammer->f;
    return STATUS_OK;
}

static double hammer_next_time(const void *values) {
    const struct hammer_values *hammer = values;
    return hammer->is_started ? hammer->start + hammer->first + hammer->strokes * hammer->period
                              : INFINITY;
}

static bool hammer_is_never_at_rest(const void *values) {
    return false;
}

static bool hammer_modes_are_possible(const void *values, bool is_held) {
    const struct hammer_values *hammer = values;
    return hammer->is_started == 1 && hammer->strokes >= 0 && hammer->hits >= 0;
}

static void hammer_describe(const void *values, struct indicator indicators[]) {
    indicators[0] = (struct indicator){
        .kind = INDICATOR_OF_STATE,
        .state = 0,
        .factor = 1.0,
        .rises = ((const struct hammer_values *)values)->v > 0.0,
    };
}

static enum status hammer_indicators(const void *values, double t, const double x[],
                                     const double u[], double z[]) {
    z[0] = x[0];
    return STATUS_OK;
}

static enum status hammer_update(void *values, const struct event *event) {
    struct hammer_values *hammer = values;
    if (!hammer->is_started) {
        hammer->is_started = 1;
        hammer->start = event->t;
    }
    if (event->triggered != NULL && event->triggered[0]) {
        hammer->x = 0.0;
        hammer->v = fabs(hammer->v);
        hammer->hits++;
    }
    if (event->is_timed) {
        hammer->strokes++;
        hammer->v += hammer->kick;
        hammer->last = hammer->f;
    }
    return STATUS_OK;
}

static const char *const hammer_names[] = {"the distance"};

static const struct model_events hammer_events = {
    .indicator_count = 1,
    .indicator_names = hammer_names,
    .modes = {offsetof(struct hammer_values, is_started), 3 * sizeof(int)},
    .discrete_states = {offsetof(struct hammer_values, start), 2 * sizeof(double)},
    .next_time = hammer_next_time,
    .are_possible = block_always,
    .modes_are_possible = hammer_modes_are_possible,
    .is_at_rest = hammer_is_never_at_rest,
    .describe = hammer_describe,
    .indicators = hammer_indicators,
    .update = hammer_update,
};

static const struct model hammer_model = MODEL(hammer, period, f, x);

/* ---- Variables ------------------------------------------------------------------------------ */

#define OF_INSTANCE(type, field)   type, VARIABLE_OF_INSTANCE, offsetof(struct instance_values, field)
#define OF_MODEL(structure, field) VARIABLE_FLOAT64, VARIABLE_OF_MODEL, offsetof(structure, field)
#define TIME                       CAUSALITY_INDEPENDENT, VARIABILITY_CONTINUOUS, INITIAL_NONE
#define TUNABLE                    CAUSALITY_PARAMETER, VARIABILITY_TUNABLE, INITIAL_EXACT
#define FIXED                      CAUSALITY_PARAMETER, VARIABILITY_FIXED, INITIAL_EXACT
#define INPUT                      CAUSALITY_INPUT, VARIABILITY_CONTINUOUS, INITIAL_NONE
#define STATE                      CAUSALITY_OUTPUT, VARIABILITY_CONTINUOUS, INITIAL_EXACT
#define OUTPUT                     CAUSALITY_OUTPUT, VARIABILITY_CONTINUOUS, INITIAL_CALCULATED
#define COUNTER                    CAUSALITY_LOCAL, VARIABILITY_DISCRETE, INITIAL_CALCULATED
#define ANY                        -INFINITY, INFINITY, 1.0
#define OF_SOLVER(reference, type, field, ...)                                                     \
    { TOY_##reference, #field, OF_INSTANCE(VARIABLE_##type, field), __VA_ARGS__ }
// clang-format off
#define OWN \
    OF_SOLVER(METHOD, ENUMERATION, solver_method, FIXED, 1.0, 1.0, 4.0, 1.0), \
    OF_SOLVER(TOLERANCE, FLOAT64, relative_tolerance, FIXED, 0.0, 0.0, INFINITY, 1.0), \
    OF_SOLVER(EVENTS, INT32, event_count, COUNTER, 0.0, ANY), \
    OF_SOLVER(LAST_EVENT, FLOAT64, last_event_time, COUNTER, 0.0, ANY), \
    OF_SOLVER(MAX_EVENTS, INT32, max_events, FIXED, 1000.0, 1.0, INFINITY, 1.0), \
    OF_SOLVER(STEPS, INT32, solver_steps, COUNTER, 0.0, ANY), \
    OF_SOLVER(RESTARTS, INT32, solver_restarts, COUNTER, 0.0, ANY), \
    OF_SOLVER(MAX_STEPS, INT32, max_internal_steps, FIXED, 100000.0, 1.0, INFINITY, 1.0), \
    OF_SOLVER(MAX_STEP, FLOAT64, max_step, FIXED, 0.0, 0.0, INFINITY, 1.0)
// clang-format on

#define OF_TOY(reference, toy, field, ...)                                                         \
    { TOY_##reference, #field, OF_MODEL(struct toy##_values, field), __VA_ARGS__ }
#define MOTION(toy, input, position, start)                                                        \
    OF_TOY(INPUT, toy, input, INPUT, 0.0, ANY),                                                    \
        OF_TOY(POSITION, toy, position, STATE, start, ANY),                                        \
        OF_TOY(SPEED, toy, v, STATE, 0.0, ANY), OF_TOY(ACCELERATION, toy, a, OUTPUT, 0.0, ANY)

static const struct variable ball_variables[] = {
    OF_SOLVER(TIME, FLOAT64, time, TIME, 0.0, ANY),
    OF_TOY(PARAMETER1, ball, g, TUNABLE, 9.81, ANY),
    OF_TOY(PARAMETER2, ball, restitution, TUNABLE, 0.8, 0.0, 1.0, 1.0),
    OF_TOY(PARAMETER3, ball, has_floor, TUNABLE, 1.0, ANY),
    MOTION(ball, lift, h, 1.0),
    OWN,
};

static const struct variable block_variables[] = {
    OF_SOLVER(TIME, FLOAT64, time, TIME, 0.0, ANY),
    OF_TOY(PARAMETER1, block, m, TUNABLE, 1.0, ANY),
    OF_TOY(PARAMETER2, block, coulomb, TUNABLE, 1.0, ANY),
    OF_TOY(PARAMETER3, block, breakaway, TUNABLE, 1.0, ANY),
    MOTION(block, f, x, 0.0),
    OWN,
};

static const struct variable hammer_variables[] = {
    OF_SOLVER(TIME, FLOAT64, time, TIME, 0.0, ANY),
    OF_TOY(PARAMETER1, hammer, period, TUNABLE, 1.0, ANY),
    OF_TOY(PARAMETER2, hammer, first, TUNABLE, 1.0, ANY),
    OF_TOY(PARAMETER3, hammer, kick, TUNABLE, 1.0, ANY),
    MOTION(hammer, f, x, 1.0),
    OWN,
};

static const short row_of_reference[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};

#define DESCRIPTION(text, model_symbol, table, indicators, has_times)                              \
    {                                                                                              \
        .name = (text), .guid = "{" text "}", .default_tolerance = 1e-8, .model = &(model_symbol), \
        .variables = (table), .variable_count = sizeof(table) / sizeof *(table),                   \
        .row_of_reference = row_of_reference, .indicator_count = (indicators),                     \
        .has_time_events = (has_times),                                                            \
        .reference_count = sizeof row_of_reference / sizeof row_of_reference[0],                   \
    }

const struct model_description ball_description =
    DESCRIPTION("Ball", ball_model, ball_variables, 2, false);
const struct model_description block_description =
    DESCRIPTION("Block", block_model, block_variables, 3, false);
const struct model_description hammer_description =
    DESCRIPTION("Hammer", hammer_model, hammer_variables, 1, true);
