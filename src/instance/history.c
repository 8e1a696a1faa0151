#include "history.h"

#include "modes.h"
#include "state.h"

#include <float.h>
#include <limits.h>
#include <math.h>
#include <string.h>

/* ---- The initial value problem -------------------------------------------------------------- */

_Static_assert((int)SERIES_INPUT_LENGTH == (int)POLYNOMIAL_DEGREE + 1,
               "the series of an input is its polynomial");

/* Writes the inputs at the time t, if they move. */
static inline void evaluate_inputs(const struct instance *instance, double t) {
    const size_t moving_count = instance->inputs_move ? count_of(instance->model->inputs) : 0;
    for (size_t i = 0; i < moving_count; i++) {
        instance->u[i] = polynomial_value(&instance->memory.active_inputs[i], t);
    }
}

/* Writes the values of inputs after a restart: constant ones are evaluated once, not at every call.
 * moves: some inputs are not constant. */
static void prepare_inputs(struct instance *instance, bool moves) {
    const bool had_moved = instance->inputs_move;
    instance->inputs_move = moves;
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        const struct polynomial *input = &instance->memory.active_inputs[i];
        double *series = instance->input_series[i];
        instance->u[i] = input->d[0];
        series[0] = input->d[0]; // the only coefficient, unless inputs move
        for (int k = 1; had_moved && k <= POLYNOMIAL_DEGREE; k++) {
            series[k] = 0.0;
        }
    }
}

enum status instance_rhs(double t, const double x[], double dx[], void *instance_pointer) {
    const struct instance *instance = instance_pointer;
    evaluate_inputs(instance, t);
    return instance->model->right_hand_side(instance->memory.restart_values,
                                            instance->state.restart_time.s + t, x, instance->u, dx);
}

enum status instance_jacobian(double t, const double x[], double J[], void *instance_pointer) {
    const struct instance *instance = instance_pointer;
    evaluate_inputs(instance, t);
    return instance->model->jacobian(instance->memory.restart_values,
                                     instance->state.restart_time.s + t, x, instance->u, J);
}

enum status instance_indicators(double t, const double x[], double z[], void *instance_pointer) {
    const struct instance *instance = instance_pointer;
    evaluate_inputs(instance, t);
    return instance->model->events->indicators(
        instance->memory.restart_values, instance->state.restart_time.s + t, x, instance->u, z);
}

void instance_rounding(const double state_errors[], double errors[], void *instance_pointer) {
    const struct instance *instance = instance_pointer;
    instance->model->events->errors(instance->memory.restart_values, instance->state.restart_time.s,
                                    state_errors, instance->memory.largest_inputs,
                                    2.0 * DBL_EPSILON, errors);
}

void instance_reach(const double x[], double reach[], void *instance_pointer) {
    const struct instance *instance = instance_pointer;
    instance->model->events->reach(instance->memory.restart_values, x, reach);
}

/* Writes the coefficients of the inputs at t, for the time scale time_scale. */
static void expand_inputs(const struct instance *instance, double t, double time_scale) {
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        double *coefficients = instance->input_series[i];
        const struct polynomial input = polynomial_shifted(&instance->memory.active_inputs[i], t);
        double power = 1.0; // time_scale^k / k!
        for (int k = 0; k <= POLYNOMIAL_DEGREE; k++) {
            coefficients[k] = input.d[k] * power;
            power *= time_scale / (k + 1);
        }
    }
}

enum status instance_series(double t, double time_scale, int first, int last,
                            double rows[][SERIES_LENGTH], void *instance_pointer) {
    const struct instance *instance = instance_pointer;
    if (first <= 1 && instance->inputs_move) {
        expand_inputs(instance, t, time_scale);
    }
    const struct series_origin origin = {
        .values = instance->memory.restart_values,
        .t = instance->state.restart_time.s + t,
        .time_scale = time_scale,
        .inputs = (const double(*)[SERIES_INPUT_LENGTH])instance->input_series,
        .has_avx2 = instance->has_avx2,
    };
    return instance->model->series->extend(&origin, first, last, rows);
}

/* ---- Anchors --------------------------------------------------------------------------------
 * The searches for solutions of equations begin at anchors in the values that the integrator runs
 * with; these move with it. Behind them are those of the restart, from which a replay begins. */

static size_t anchors_size(const struct model *model) {
    return model->anchors.size / 2;
}

void instance_settle(double t, const double x[], void *instance_pointer) {
    const struct instance *instance = instance_pointer;
    const struct model *model = instance->model;
    char *values = instance->memory.restart_values;
    evaluate_inputs(instance, t);
    model->anchor(values, instance->state.restart_time.s + t, x, instance->u, SEARCH_NEAR,
                  doubles_of(values, model->anchors));
}

void instance_take_anchors(struct instance *instance) {
    const struct instance_memory *memory = &instance->memory;
    const struct range anchors = instance->model->anchors;
    memcpy(memory->values + anchors.offset, memory->restart_values + anchors.offset,
           anchors_size(instance->model));
}

/* Notes the present anchors as those of the restart. */
static void keep_anchors(struct instance *instance) {
    instance_move_anchors(instance);
    char *anchors = instance->memory.values + instance->model->anchors.offset;
    memcpy(anchors + anchors_size(instance->model), anchors, anchors_size(instance->model));
}

/* Lets the integrator run with the anchors of the restart again. */
static void restore_anchors(struct instance *instance) {
    char *anchors = instance->memory.restart_values + instance->model->anchors.offset;
    memcpy(anchors, anchors + anchors_size(instance->model), anchors_size(instance->model));
}

/* ---- Continuing ----------------------------------------------------------------------------- */

/* True if there can be state events with the parameters that the integrator runs with. */
static bool is_searched(const struct instance *instance) {
    const struct model_events *events = instance->model->events;
    return events != NULL && events->are_possible != NULL &&
           events->are_possible(instance->memory.restart_values);
}

/* Returns the indicators of the current modes, for the integrator; NULL if no event is possible. */
static const struct indicator *describe_indicators(struct instance *instance) {
    if (instance->indicators_are_active) {
        return instance->indicators;
    }
    if (!is_searched(instance)) {
        return NULL;
    }
    instance->model->events->describe(instance->memory.restart_values, instance->indicators);
    instance->indicators_are_active = true;
    return instance->indicators;
}

/* Returns integrator_longest_history of the method, in the current modes. */
static int64_t longest_history(const struct instance *instance) {
    return integrator_longest_history(instance->configured.method, is_searched(instance));
}

/* This depends only on the values set now and the integrator's, not on how often or in what order
 * they were set.
 *
 * Any change of an input restarts it. Measured with inputs sampled from sines every 1 ms,
 * continuing CVODE's history over a jump has 450 times the error of a restart and is slower if
 * jumps are 4e-4 of the input, has 40 times the error at 4e-6 and 4 times at 4e-8. It gains only
 * below 1e-9, and rollback would have to replay every jump. */
enum continuation instance_continuation(const struct instance *instance, double target) {
    const struct instance_state *state = &instance->state;
    const bool continues =
        state->has_history && target <= state->horizon && instance_values_are_active(instance);
    if (!continues) {
        return state->event_point == EVENT_HANDLED && instance_is_unchanged(instance)
                   ? CONTINUE_AFTER_EVENT
                   : CONTINUE_AFTER_CHANGE;
    }
    const int64_t steps = state->statistics.steps - state->steps_before_restart;
    if (target > state->passed_time && steps >= longest_history(instance)) {
        return CONTINUE_AFTER_RESTART;
    }
    return instance->history_is_lost ? CONTINUE_AFTER_REPLAY : CONTINUE_NOW;
}

void instance_update_next_step(struct instance *instance) {
    if (instance->state.has_history && !instance->history_is_lost) {
        instance->state.next_step = integrator_next_step(instance->integrator);
    }
}

static struct integrator_start start_of(struct instance *instance) {
    const struct instance_state *state = &instance->state;
    const bool keeps_indicators = instance->indicators_are_active;
    return (struct integrator_start){
        .origin = state->restart_time.s,
        .horizon = state->horizon,
        .first_step = state->restart_step,
        .continues = state->restart_continues,
        .is_after_event = state->restart_after_event,
        .keeps_indicators = keeps_indicators,
        .indicators = describe_indicators(instance),
    };
}

/* Makes the integrator run with the values that are set now; range: of a value structure. */
static void activate(struct instance *instance, struct range range) {
    memcpy(instance->memory.restart_values + range.offset, instance->memory.values + range.offset,
           range.size);
}

/* Ends the history: times since the restart count from the current time on. */
static void end_history(struct instance *instance) {
    instance->state.restart_time = instance->state.time;
    instance->state.has_history = false;
    instance->history_is_lost = false;
}

/* Inputs that move are polynomials for this step only; constant ones may stay to the stop time. */
double instance_horizon(const struct instance_state *state, struct clock_time restart,
                        double target, bool inputs_move) {
    if (inputs_move) {
        return target;
    }
    const struct clock_time stop = {.s = state->experiment.stop_time};
    return state->experiment.stop_time_defined ? fmax(clock_difference(stop, restart), target)
                                               : INFINITY;
}

/* Makes the integrator run, from the current time on, with the values that are set now, and with
 * these polynomials of time as inputs, at least up to the time end. Ends the history. */
static inline void activate_values(struct instance *instance, struct clock_time end,
                                   const struct polynomial inputs[], bool has_new_parameters) {
    struct instance_memory *memory = &instance->memory;
    struct instance_state *state = &instance->state;
    const struct model *model = instance->model;
    if (has_new_parameters) {
        activate(instance, model->parameters);
    }
    keep_anchors(instance);
    activate(instance, memory->written);
    instance->parameters_are_active = true;
    instance_note_inputs(instance);
    const size_t input_count = count_of(model->inputs);
    memcpy(memory->active_inputs, inputs, input_count * sizeof *inputs);
    prepare_inputs(instance, !instance->inputs_are_held &&
                                 polynomials_move(memory->active_inputs, input_count));

    const double target = clock_difference(end, state->time);
    state->horizon = instance_horizon(state, state->time, target, instance->inputs_move);
    state->first_time = target;
    end_history(instance); // until the first advance has succeeded
}

/* Replays the number of internal steps that the state gives. A forged state fails here. */
enum status instance_replay_history(struct instance *instance) {
    const struct instance_state *state = &instance->state;
    const struct range states = instance->model->states;
    const int64_t steps = state->statistics.steps - state->steps_before_restart;
    double *x = doubles_of(instance->first_derivatives, states);
    double reached;
    prepare_inputs(instance, polynomials_move(instance->memory.active_inputs,
                                              count_of(instance->model->inputs)));
    restore_anchors(instance);
    const struct integrator_start start = start_of(instance);
    enum status status = integrator_restart(
        instance->integrator, doubles_of(instance->memory.restart_values, states), &start);
    if (status == STATUS_OK) {
        status = integrator_advance(instance->integrator, state->first_time, steps, &reached, x);
    }
    if (status == STATUS_OK && state->latest_time > state->first_time) {
        status = integrator_advance(instance->integrator, state->latest_time, steps, &reached, x);
    }
    *integrator_totals(instance->integrator) = state->statistics;
    instance->history_is_lost = false;
    if (status != STATUS_OK || integrator_passed_time(instance->integrator) != state->passed_time) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "the restored state cannot be continued: it contradicts itself");
        return STATUS_INVALID_ARGUMENT;
    }
    return STATUS_OK;
}

enum status instance_prepare_history(struct instance *instance, struct clock_time end,
                                     enum continuation continuation) {
    if (continuation == CONTINUE_NOW) {
        return STATUS_OK;
    }
    if (continuation == CONTINUE_AFTER_REPLAY) {
        return instance_replay_history(instance);
    }
    struct instance_memory *memory = &instance->memory;
    struct instance_state *state = &instance->state;
    const bool is_event = continuation == CONTINUE_AFTER_EVENT;
    const bool has_new_parameters = !instance_parameters_are_active(instance);
    // the last step gives the length of the first one, unless the parameters have changed
    if (has_new_parameters) {
        state->next_step = 0.0;
    } else if (!is_event) {
        instance_update_next_step(instance);
    }
    activate_values(instance, end, is_event ? memory->current_inputs : memory->next_inputs,
                    has_new_parameters);

    // note the restart for a replay
    state->steps_before_restart = state->statistics.steps;
    state->restart_step = state->next_step;
    state->restart_continues = continuation != CONTINUE_AFTER_CHANGE;
    state->restart_after_event = is_event;
    // after a change, no update since the last restart means that the model moves on
    instance->indicators_are_active &= continuation == CONTINUE_AFTER_CHANGE && !has_new_parameters;
    const struct integrator_start start = start_of(instance);
    return integrator_restart(instance->integrator,
                              doubles_of(memory->restart_values, instance->model->states), &start);
}

enum status instance_rest(struct instance *instance, struct clock_time end, struct clock_time until,
                          bool meets_time_event, enum continuation continuation) {
    struct instance_state *state = &instance->state;
    const struct polynomial *inputs = continuation == CONTINUE_AFTER_EVENT
                                          ? instance->memory.current_inputs
                                          : instance->memory.next_inputs;
    // without states the time may end a mode; with states at rest, only inputs that move. The
    // active values matter only after an event
    const bool inputs_move =
        !instance->inputs_are_held && polynomials_move(inputs, count_of(instance->model->inputs));
    const bool searches = inputs_move || instance->model->states.size == 0;
    if (searches || meets_time_event) {
        activate_values(instance, end, inputs, !instance_parameters_are_active(instance));
    } else {
        end_history(instance);
    }
    instance->indicators_are_active = false;
    const struct integrator_start start = {
        .indicators = searches ? describe_indicators(instance) : NULL,
    };
    state->next_step = 0.0;
    return integrator_rest(instance->integrator,
                           doubles_of(instance->memory.values, instance->model->states), &start,
                           clock_difference(until, state->restart_time), &state->latest_time);
}

/* ---- After a part of a step ----------------------------------------------------------------- */

static int saturated(int64_t count) {
    return count > INT_MAX ? INT_MAX : (int)count;
}

void instance_write_statistics(const struct integrator_statistics *statistics,
                               struct instance_values *own) {
    own->solver_steps = saturated(statistics->steps);
    own->solver_rhs_evaluations = saturated(statistics->rhs_evaluations);
    own->solver_restarts = saturated(statistics->restarts);
    own->solver_failed_steps = saturated(statistics->failed_steps);
    own->solver_last_step = statistics->last_step;
    own->solver_last_order = statistics->last_order;
}

void instance_note_part(struct instance *instance, enum status status, bool is_whole) {
    struct instance_state *state = &instance->state;
    if (status != STATUS_OK) {
        instance_set_clock(instance, clock_add(state->restart_time, state->latest_time));
    }
    state->has_history = status == STATUS_OK && is_whole && longest_history(instance) > 0;
    state->passed_time = integrator_passed_time(instance->integrator);
    if (!state->has_history) {
        state->next_step = status == STATUS_OK ? integrator_next_step(instance->integrator) : 0.0;
    }
    instance_write_statistics(&state->statistics, &state->own);
}
