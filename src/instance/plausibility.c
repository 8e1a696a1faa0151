#include "plausibility.h"

#include "settings.h"

#include <limits.h>
#include <math.h>
#include <string.h>

/* A value by its name, and whether an instance can have it. */
struct named_value {
    const char *name;
    double value;
    bool is_possible;
};

static bool are_possible(const struct instance *instance, const struct named_value values[],
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
    return value >= 0 && value <= INT64_MAX / 2; // can be counted on from without overflow
}

static bool is_step(double value) {
    return value >= 0.0 && isfinite(value);
}

/* Time, phase and the settings of the integrator. */
static bool has_possible_settings(const struct instance *instance,
                                  const struct instance_state *state) {
    const struct instance_values *own = &state->own;
    const double tolerance = own->effective_relative_tolerance;
    const int phase = (int)state->phase;
    const struct named_value values[] = {
        {"phase", phase, phase >= 0 && phase < PHASE_COUNT},
        {"time", state->time.s, isfinite(state->time.s)},
        {"the rest of time", state->time.rest, isfinite(state->time.rest)},
        {"the variable time", own->time, isfinite(own->time)},
        {"relative_tolerance", own->relative_tolerance, is_step(own->relative_tolerance)},
        {"effective_relative_tolerance", tolerance,
         tolerance >= INSTANCE_FINEST_TOLERANCE && tolerance <= INSTANCE_COARSEST_TOLERANCE},
        {"max_step", own->max_step, is_step(own->max_step)},
        {"max_internal_steps", own->max_internal_steps, own->max_internal_steps >= 1},
        {"max_events", own->max_events, own->max_events >= 1},
        {"event_count", own->event_count, own->event_count >= 0},
        {"last_event_time", own->last_event_time, isfinite(own->last_event_time)},
        {"solver_method", own->solver_method,
         own->solver_method > INTEGRATOR_NO_METHOD && own->solver_method < INTEGRATOR_METHODS &&
             (!instance_has_integrator(instance) ||
              integrator_is_possible((enum integrator_method)own->solver_method, &instance->ode))},
    };
    return are_possible(instance, values, COUNT(values)) &&
           (!state->experiment_defined ||
            instance_check_experiment(instance, &state->experiment) == STATUS_OK);
}

static bool has_possible_statistics(const struct instance *instance,
                                    const struct instance_state *state) {
    const struct integrator_statistics *totals = &state->statistics;
    const struct named_value values[] = {
        {"solver_steps", (double)totals->steps, is_count(totals->steps)},
        {"solver_rhs_evaluations", (double)totals->rhs_evaluations,
         is_count(totals->rhs_evaluations)},
        {"solver_failed_steps", (double)totals->failed_steps, is_count(totals->failed_steps)},
        {"solver_restarts", (double)totals->restarts, is_count(totals->restarts)},
        {"last_step", totals->last_step, isfinite(totals->last_step)},
        {"solver_last_step", state->own.solver_last_step, isfinite(state->own.solver_last_step)},
        {"the steps before the restart", (double)state->steps_before_restart,
         state->steps_before_restart >= 0 && state->steps_before_restart <= totals->steps},
    };
    return are_possible(instance, values, COUNT(values));
}

/* What a replay of the integrator's history needs. */
static bool has_possible_history(const struct instance *instance,
                                 const struct instance_state *state) {
    const int64_t steps = state->statistics.steps - state->steps_before_restart;
    const int64_t most_steps =
        integrator_longest_history((enum integrator_method)state->own.solver_method,
                                   instance->model->events != NULL) +
        (int64_t)state->own.max_internal_steps;
    const bool exists = state->has_history;
    const struct named_value values[] = {
        {"restart_time", state->restart_time.s, isfinite(state->restart_time.s)},
        {"the rest of restart_time", state->restart_time.rest, isfinite(state->restart_time.rest)},
        {"restart_step", state->restart_step, is_step(state->restart_step)},
        {"next_step", state->next_step, is_step(state->next_step)},
        {"the steps since the restart", (double)steps,
         !exists || (steps > 0 && steps <= most_steps)},
        {"first_time", state->first_time, !exists || state->first_time > 0.0},
        {"latest_time", state->latest_time,
         !exists || (state->latest_time >= state->first_time && isfinite(state->latest_time))},
        {"passed_time", state->passed_time, !exists || state->passed_time >= state->first_time},
        {"span", state->span, !exists || state->span >= state->latest_time},
    };
    return are_possible(instance, values, COUNT(values));
}

static bool are_finite_inputs(const struct instance *instance, const char *name,
                              const struct polynomial *inputs) {
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        for (int k = 0; k <= POLYNOMIAL_DEGREE; k++) {
            const struct named_value value = {name, inputs[i].d[k], isfinite(inputs[i].d[k])};
            if (!are_possible(instance, &value, 1)) {
                return false;
            }
        }
    }
    return true;
}

/* Parameters, inputs and states that could have been set, and modes and discrete states within
 * their limits. */
static bool are_within_limits(const struct instance *instance, const char *values) {
    const struct message_sink quiet = {0};
    for (size_t i = 0; i < instance->description->variable_count; i++) {
        const struct variable *variable = &instance->description->variables[i];
        const void *field = values + variable->offset;
        if (variable->owner != VARIABLE_OF_MODEL ||
            instance->places[variable->reference].is_calculated) {
            continue;
        }
        const double number =
            variable->type == VARIABLE_FLOAT64 ? *(const double *)field : *(const int *)field;
        const struct named_value value = {
            variable->name, number, variable_check_value(variable, number, &quiet) == STATUS_OK};
        if (!are_possible(instance, &value, 1)) {
            return false;
        }
    }
    return true;
}

/* Discrete states that are no variables. */
static bool are_finite_kept(const struct instance *instance, const char *values) {
    const struct span kept = events_of(instance->model).discrete_states;
    for (size_t i = 0; i < count_of(kept); i++) {
        const double state = ((const double *)(const void *)(values + kept.offset))[i];
        const struct named_value value = {"a discrete state", state, isfinite(state)};
        if (!are_possible(instance, &value, 1)) {
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

static bool are_zeros(const char *values, struct span span) {
    for (size_t i = 0; i < span.size; i++) {
        if (values[span.offset + i] != 0) {
            return false;
        }
    }
    return true;
}

/* Modes of values, which may have been set since the last event, and those that the integrator runs
 * with. While it goes on no event has been. */
static bool has_possible_modes(const struct instance *instance, const struct instance_state *state,
                               const char *values, const char *held) {
    const struct model_events *events = instance->model->events;
    if (events == NULL) {
        return true;
    }
    const struct span modes = events->modes;
    const bool is_decided = state->phase >= PHASE_STEPPING;
    if (is_decided ? !events->modes_are_possible(values, false)
                   : !are_zeros(values, modes) || !are_zeros(values, events->discrete_states)) {
        return refuse_modes(instance, "the modes");
    }
    if (state->has_history &&
        (memcmp(values + modes.offset, held + modes.offset, modes.size) != 0 ||
         !events->modes_are_possible(held, true))) {
        return refuse_modes(instance, "the modes since the restart");
    }
    return true;
}

/* Steps pass time events as they come: none is left behind the present time. An importer that
 * integrates outside may pass one over. */
static bool has_possible_next_time(const struct instance *instance,
                                   const struct instance_state *state, const char *values) {
    const struct model_events *events = instance->model->events;
    if (events == NULL || events->next_time == NULL || state->phase < PHASE_STEPPING ||
        instance->is_integrated_outside) {
        return true;
    }
    const double time = events->next_time(values);
    const struct named_value value = {"the time of the next event", time, time >= state->time.s};
    return are_possible(instance, &value, 1);
}

/* A value structure that the instance can have. */
static bool is_possible_structure(const struct instance *instance, const char *values) {
    return are_within_limits(instance, values) && are_finite_kept(instance, values);
}

/* An event that is due is one of an indicator or of the time. */
static bool is_possible_event_point(const struct instance *instance,
                                    const struct instance_state *state, const bool due[]) {
    int count = 0;
    for (size_t i = 0; i < instance_event_size(instance->model) / sizeof *due; i++) {
        count += due[i];
    }
    const bool is_due = state->event_point == EVENT_DUE;
    const bool is_stepping = state->phase == PHASE_STEPPING && !instance->is_integrated_outside &&
                             instance->model->events != NULL;
    const struct clock_time end = state->cut_end;
    const struct named_value values[] = {
        {"event_point", state->event_point,
         state->event_point == NO_EVENT ||
             (is_stepping && (is_due || state->event_point == EVENT_PASSED))},
        {"the number of causes of the event that is due", count, is_due == (count > 0)},
        {"the end of the step cut short", end.s, isfinite(end.s)},
        {"the rest of the end of the step cut short", end.rest, isfinite(end.rest)},
    };
    return are_possible(instance, values, COUNT(values));
}

enum status instance_check_plausible(const struct instance *instance,
                                     const struct instance_state *state, const char *block) {
    // places in block as in the instance's own
    const struct instance_memory *memory = &instance->memory;
    const char *values = block + (memory->values - memory->block);
    const char *held = block + (memory->held - memory->block);
    const char *pending = block + ((const char *)memory->pending - memory->block);
    const char *running = block + ((const char *)memory->running - memory->block);

    // inputs at the current time are not checked: they may have overflowed on their way
    const bool is_plausible =
        has_possible_settings(instance, state) && has_possible_statistics(instance, state) &&
        has_possible_history(instance, state) &&
        are_finite_inputs(instance, "an input", (const void *)pending) &&
        are_finite_inputs(instance, "an input since the restart", (const void *)running) &&
        is_possible_structure(instance, values) &&
        (!state->has_history || is_possible_structure(instance, held)) &&
        has_possible_modes(instance, state, values, held) &&
        has_possible_next_time(instance, state, values) &&
        is_possible_event_point(
            instance, state, (const void *)(block + ((const char *)memory->due - memory->block)));
    return is_plausible ? STATUS_OK : STATUS_INVALID_ARGUMENT;
}
