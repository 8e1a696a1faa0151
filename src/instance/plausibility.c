#include "plausibility.h"

#include "history.h"
#include "state.h"

#include <math.h>
#include <string.h>

/* A value with its name, and whether an instance can have it. */
struct named_value {
    const char *name;
    double value;
    bool is_possible;
};

static bool check_all(const struct instance *instance, const struct named_value values[],
                      size_t count) {
    for (size_t i = 0; i < count; i++) {
        if (!values[i].is_possible) {
            message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                          "the serialized state is refused: %s = %.17g is impossible",
                          values[i].name, values[i].value);
            return false;
        }
    }
    return true;
}

#define COUNT(array) (sizeof(array) / sizeof(array)[0])

static bool is_count(int64_t value) {
    return value >= 0 && value <= INT64_MAX / 2; // counting on will not overflow
}

static bool is_step(double value) {
    return value >= 0.0 && isfinite(value);
}

/* True if s is the whole time, rounded. */
static bool is_rest_of(struct clock_time time) {
    return clock_two_sum(time.s, time.rest).s == time.s;
}

/* Checks time, phase and the settings of the integrator. */
static bool check_settings(const struct instance *instance, const struct instance_state *state) {
    const struct instance_values *own = &state->own;
    const int phase = (int)state->phase;
    // an integrator outside may go back, before the start too
    const bool only_advances = phase == PHASE_STEPPING && !instance->is_integrated_outside;
    const double start = state->experiment.start_time;
    const struct named_value values[] = {
        {"phase", phase, phase >= 0 && phase < PHASE_COUNT},
        {"time", state->time.s,
         isfinite(state->time.s) && (!only_advances || state->time.s >= start)},
        {"the rest of time", state->time.rest, is_rest_of(state->time)},
        {"drift", state->drift, is_step(state->drift)},
        {"relative_tolerance", own->relative_tolerance, is_step(own->relative_tolerance)},
        {"max_step", own->max_step, is_step(own->max_step)},
        {"max_internal_steps", own->max_internal_steps, own->max_internal_steps >= 1},
        {"max_events", own->max_events, own->max_events >= 1},
        {"event_count", own->event_count, own->event_count >= 0},
        {"last_event_time", own->last_event_time,
         isfinite(own->last_event_time) &&
             (!only_advances ||
              (own->last_event_time >= start && own->last_event_time <= state->time.s))},
        {"solver_method", own->solver_method,
         own->solver_method > INTEGRATOR_NO_METHOD && own->solver_method < INTEGRATOR_METHODS &&
             (!instance_has_integrator(instance) ||
              integrator_is_possible((enum integrator_method)own->solver_method, &instance->ode))},
    };
    return check_all(instance, values, COUNT(values)) &&
           instance_check_experiment(instance, &state->experiment) == STATUS_OK;
}

static bool check_statistics(const struct instance *instance, const struct instance_state *state) {
    const struct integrator_statistics *totals = &state->statistics;
    const struct named_value values[] = {
        {"solver_steps", (double)totals->steps, is_count(totals->steps)},
        {"solver_rhs_evaluations", (double)totals->rhs_evaluations,
         is_count(totals->rhs_evaluations)},
        {"solver_failed_steps", (double)totals->failed_steps, is_count(totals->failed_steps)},
        {"solver_restarts", (double)totals->restarts, is_count(totals->restarts)},
        {"last_step", totals->last_step, isfinite(totals->last_step)},
        {"the steps before the restart", (double)state->steps_before_restart,
         state->steps_before_restart >= 0 && state->steps_before_restart <= totals->steps},
    };
    return check_all(instance, values, COUNT(values));
}

/* Checks the values for a replay of the integrator's history. */
static bool check_history(const struct instance *instance, const struct instance_state *state,
                          const struct polynomial active_inputs[]) {
    const double latest = clock_difference(state->time, state->restart_time);
    const double horizon =
        instance_horizon(state, state->restart_time, state->first_time,
                         polynomials_move(active_inputs, count_of(instance->model->inputs)));
    const int64_t steps = state->statistics.steps - state->steps_before_restart;
    const int64_t most_steps =
        integrator_longest_history((enum integrator_method)state->own.solver_method,
                                   instance->model->events != NULL) +
        (int64_t)state->own.max_internal_steps;
    const bool exists = state->has_history;
    const struct named_value values[] = {
        {"restart_time", state->restart_time.s, isfinite(state->restart_time.s)},
        {"the rest of restart_time", state->restart_time.rest, is_rest_of(state->restart_time)},
        {"restart_step", state->restart_step, is_step(state->restart_step)},
        {"next_step", state->next_step, is_step(state->next_step)},
        {"solver_restarts", (double)state->statistics.restarts,
         !exists || state->statistics.restarts > 0},
        {"the steps since the restart", (double)steps,
         !exists || (steps > 0 && steps <= most_steps)},
        {"first_time", state->first_time, !exists || state->first_time > 0.0},
        {"the time since the restart", latest,
         !exists || (latest >= state->first_time && isfinite(latest))},
        {"passed_time", state->passed_time, !exists || state->passed_time >= state->first_time},
        {"horizon", horizon, !exists || horizon >= latest},
    };
    return check_all(instance, values, COUNT(values));
}

static bool check_inputs(const struct instance *instance, const char *name,
                         const struct polynomial *inputs) {
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        for (int k = 0; k <= POLYNOMIAL_DEGREE; k++) {
            const struct named_value value = {name, inputs[i].d[k], isfinite(inputs[i].d[k])};
            if (!check_all(instance, &value, 1)) {
                return false;
            }
        }
    }
    return true;
}

/* Checks that parameters, inputs and states could have been set, and that modes and discrete states
 * are within their limits. */
static bool check_limits(const struct instance *instance, const char *values) {
    const struct message_sink quiet = {0};
    for (size_t i = 0; i < instance->description->variable_count; i++) {
        const struct variable *variable = &instance->description->variables[i];
        const void *field = values + variable->offset;
        if (variable->owner != VARIABLE_OF_MODEL ||
            instance->reals[variable->reference].is_calculated) {
            continue;
        }
        const double number =
            variable->type == VARIABLE_FLOAT64 ? *(const double *)field : *(const int *)field;
        const struct named_value value = {
            variable->name, number, variable_check_value(variable, number, &quiet) == STATUS_OK};
        if (!check_all(instance, &value, 1)) {
            return false;
        }
    }
    return true;
}

/* Checks that discrete states and anchors are finite, also those that are no variables. */
static bool check_kept(const struct instance *instance, const char *values, struct range kept) {
    for (size_t i = 0; i < count_of(kept); i++) {
        const double state = ((const double *)(const void *)(values + kept.offset))[i];
        const struct named_value value = {"a discrete state", state, isfinite(state)};
        if (!check_all(instance, &value, 1)) {
            return false;
        }
    }
    return true;
}

static bool refuse_modes(const struct instance *instance, const char *name) {
    message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                  "the serialized state is refused: %s are impossible", name);
    return false;
}

static bool are_zeros(const char *values, struct range range) {
    for (size_t i = 0; i < range.size; i++) {
        if (values[range.offset + i] != 0) {
            return false;
        }
    }
    return true;
}

static bool are_equal(const char *values, const char *others, struct range range) {
    return memcmp(values + range.offset, others + range.offset, range.size) == 0;
}

/* True if no event has written a discrete state: all are 0, except those with start values. */
static bool are_at_start(const struct instance *instance, const char *values) {
    const struct range kept = events_of(instance->model).discrete_states;
    size_t others = 0; // than 0
    for (size_t i = 0; i < count_of(kept); i++) {
        others += ((const double *)(const void *)(values + kept.offset))[i] == 0.0 ? 0 : 1;
    }
    size_t started = 0; // and not 0
    for (size_t i = 0; i < instance->description->variable_count; i++) {
        const struct variable *variable = &instance->description->variables[i];
        if (variable_is_discrete_state(variable) && variable->initial == INITIAL_EXACT) {
            const double value = *(const double *)(const void *)(values + variable->offset);
            started += value == 0.0 ? 0 : 1;
        }
    }
    return others == started;
}

/* Checks the modes of values, which may have been set since the last event, and the integrator's
 * modes. They are equal while the history lasts, as are discrete states: an event would have ended
 * it. */
static bool check_modes(const struct instance *instance, const struct instance_state *state,
                        const char *values, const char *restart_values) {
    const struct model_events *events = instance->model->events;
    if (events == NULL) {
        return true;
    }
    const struct range modes = events->modes;
    const bool is_decided = state->phase >= PHASE_STEPPING;
    if (is_decided ? !events->modes_are_possible(values, false)
                   : !are_zeros(values, modes) || !are_at_start(instance, values)) {
        return refuse_modes(instance, "the modes");
    }
    if (state->has_history && (!are_equal(values, restart_values, modes) ||
                               !are_equal(values, restart_values, events->discrete_states) ||
                               !events->modes_are_possible(restart_values, true))) {
        return refuse_modes(instance, "the modes since the restart");
    }
    return true;
}

/* Checks the next time event. Steps handle time events as they come: none is earlier than the
 * current time by more than rounding. An importer that integrates outside may skip one. */
static bool check_next_time(const struct instance *instance, const struct instance_state *state,
                            const char *values) {
    const struct model_events *events = instance->model->events;
    if (events == NULL || events->next_time == NULL || state->phase < PHASE_STEPPING ||
        instance->is_integrated_outside) {
        return true;
    }
    const double time = events->next_time(values);
    const double size = fmax(fabs(state->time.s), fabs(state->experiment.start_time));
    const struct named_value value = {"the time of the next event", time,
                                      time >=
                                          state->time.s - (state->drift + clock_rounding(size))};
    return check_all(instance, &value, 1);
}

/* Checks that the instance can have a value structure. */
static bool check_structure(const struct instance *instance, const char *values) {
    const struct model *model = instance->model;
    return check_limits(instance, values) &&
           check_kept(instance, values, events_of(model).discrete_states) &&
           check_kept(instance, values, model->anchors);
}

/* Checks the event at which the last step ended: an unhandled event has an indicator or the time as
 * its cause. */
static bool check_event_point(const struct instance *instance, const struct instance_state *state,
                              const bool unhandled[]) {
    int count = 0;
    for (size_t i = 0; i < instance_event_size(instance->model) / sizeof *unhandled; i++) {
        count += unhandled[i];
    }
    const bool is_unhandled = state->event_point == EVENT_UNHANDLED;
    const bool is_stepping = state->phase == PHASE_STEPPING && instance->model->events != NULL;
    const bool is_handled = state->event_point == EVENT_HANDLED && !instance->is_integrated_outside;
    const struct clock_time end = state->cut_end;
    const struct named_value values[] = {
        {"event_point", state->event_point,
         state->event_point == NO_EVENT ||
             (is_stepping && !state->has_history && (is_unhandled || is_handled))},
        {"the number of causes of the unhandled event", count, is_unhandled == (count > 0)},
        {"the end of the step cut short", end.s, isfinite(end.s)},
        {"the rest of the end of the step cut short", end.rest,
         is_rest_of(end) && (state->event_point == NO_EVENT || instance->is_integrated_outside ||
                             clock_difference(end, state->time) >= -clock_spacing(state->time.s))},
    };
    return check_all(instance, values, COUNT(values));
}

/* ---- Values stored twice -------------------------------------------------------------------- */

/* A value with its name, and the value that follows from the rest of the state. */
struct twin {
    const char *name;
    double value;
    double expected;
};

static bool check_twins(const struct instance *instance, const struct twin twins[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        if (twins[i].value != twins[i].expected) {
            message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                          "the serialized state is refused: %s = %.17g contradicts the rest of it, "
                          "which gives %.17g",
                          twins[i].name, twins[i].value, twins[i].expected);
            return false;
        }
    }
    return true;
}

/* Checks that the start is the experiment's, and that nothing has been counted before it. */
static bool check_start(const struct instance *instance, const struct instance_state *state) {
    const struct instance_values *own = &state->own;
    const bool has_started = state->phase >= PHASE_STEPPING;
    const bool knows_start = state->phase >= PHASE_INITIALIZATION;
    // of the other kind: the adapter refuses it
    const bool is_foreign =
        state->phase == PHASE_CONTINUOUS_TIME && !instance->is_integrated_outside;
    const double start = state->experiment.start_time;
    const struct twin of_start[] = {
        {"time", state->time.s, start},
        {"the rest of time", state->time.rest, 0.0},
        {"drift", state->drift, 0.0},
        {"has_history", state->has_history, false},
        {"solver_steps", (double)state->statistics.steps, 0.0},
        {"event_count", own->event_count, 0.0},
    };
    const struct twin of_events[] = {
        {"last_event_time", own->last_event_time, knows_start ? start : 0.0},
    };
    const struct twin of_experiment[] = {
        {"experiment_defined", state->experiment_defined, true},
    };
    const struct twin of_no_experiment[] = {
        {"start_time", start, 0.0},
        {"stop_time_defined", state->experiment.stop_time_defined, false},
        {"tolerance_defined", state->experiment.tolerance_defined, false},
    };
    return (has_started || check_twins(instance, of_start, COUNT(of_start))) &&
           (own->event_count > 0 || check_twins(instance, of_events, COUNT(of_events))) &&
           (state->phase == PHASE_INSTANTIATED || is_foreign ||
            check_twins(instance, of_experiment, COUNT(of_experiment))) &&
           (state->experiment_defined ||
            check_twins(instance, of_no_experiment, COUNT(of_no_experiment)));
}

/* Checks values that are stored twice: inputs at the current time are among the values, too, fixed
 * parameters also among the integrator's. */
static bool check_value_twins(const struct instance *instance, const struct instance_state *state,
                              const char *values, const char *restart_values,
                              const struct polynomial current[]) {
    for (size_t i = 0; i < instance->description->variable_count; i++) {
        const struct variable *variable = &instance->description->variables[i];
        const bool is_real = variable->type == VARIABLE_FLOAT64;
        const char *field = values + variable->offset;
        const void *twin = field;
        if (variable->owner != VARIABLE_OF_MODEL) {
            continue;
        }
        if (variable->causality == CAUSALITY_INPUT && is_real) {
            twin = &current[instance_input_index(instance, variable)].d[0];
        } else if (variable->causality == CAUSALITY_PARAMETER && state->has_history &&
                   variable->variability == VARIABILITY_FIXED) {
            twin = restart_values + variable->offset;
        }
        if (memcmp(field, twin, is_real ? sizeof(double) : sizeof(int)) != 0) {
            message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                          "the serialized state is refused: it has two values of %s",
                          variable->name);
            return false;
        }
    }
    return true;
}

enum status instance_check_plausible(const struct instance *instance,
                                     const struct instance_state *state, const char *block) {
    // offsets in the instance's own block
    const struct instance_memory *memory = &instance->memory;
    const char *values = block + (memory->values - memory->block);
    const char *restart_values = block + (memory->restart_values - memory->block);
    const char *next_inputs = block + ((const char *)memory->next_inputs - memory->block);
    const char *current = block + ((const char *)memory->current_inputs - memory->block);
    const char *active_inputs = block + ((const char *)memory->active_inputs - memory->block);

    // derivatives of inputs at the current time are not checked: they may have overflowed
    const bool is_plausible =
        check_settings(instance, state) && check_statistics(instance, state) &&
        check_history(instance, state, (const void *)active_inputs) &&
        check_inputs(instance, "an input", (const void *)next_inputs) &&
        check_inputs(instance, "an input since the restart", (const void *)active_inputs) &&
        check_structure(instance, values) &&
        (!state->has_history || check_structure(instance, restart_values)) &&
        check_modes(instance, state, values, restart_values) &&
        check_next_time(instance, state, values) &&
        check_event_point(
            instance, state,
            (const void *)(block + ((const char *)memory->unhandled - memory->block))) &&
        check_start(instance, state) &&
        check_value_twins(instance, state, values, restart_values, (const void *)current);
    return is_plausible ? STATUS_OK : STATUS_INVALID_ARGUMENT;
}
