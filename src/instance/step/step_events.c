#include "step.h"

#include "event_point.h"
#include "fields.h"

#include <string.h>

/* As instance_move in modes in which no state moves: time passes until an input ends them. */
static enum status rest(struct step *step, enum continuation continuation) {
    struct instance *instance = step->instance;
    struct instance_state *state = &instance->state;
    const struct polynomial *inputs = continuation == CONTINUE_AFTER_EVENT
                                          ? instance->memory.current_inputs
                                          : instance->memory.next_inputs;
    // constant inputs end no mode; the active values matter only after an event
    const bool is_searched =
        !instance->inputs_are_held && polynomials_move(inputs, count_of(instance->model->inputs));
    if (is_searched || step->meets_time_event) {
        instance_activate_values(instance, step->end, inputs);
    } else {
        instance_end_history(instance);
    }
    const struct integrator_start start = {
        .indicators = is_searched ? instance_describe_indicators(instance) : NULL,
    };
    state->next_step = 0.0;
    return integrator_rest(instance->integrator,
                           doubles_of(instance->memory.values, instance->model->states), &start,
                           clock_difference(step->until, state->restart_time), &state->latest_time);
}

/* The instance goes to the time of an event and handles it, or the step ends there. */
static enum status meet_event(struct step *step, struct clock_time time) {
    struct instance *instance = step->instance;
    struct instance_state *state = &instance->state;
    const bool *triggered = instance->triggered;
    const struct clock_time end = step->end;
    instance_set_clock(instance, time);
    instance_evaluate_inputs(instance, clock_difference(state->time, step->begin));
    instance->step_met_event = true;
    if (step->options->at_event != EVENTS_PASSED && state->time.s > step->begin.s) {
        step->is_early = clock_difference(end, state->time) > 0.0;
        step->end = state->time;
        if (step->options->at_event == EVENTS_LEFT) {
            instance_leave_event(instance, triggered, end);
            return STATUS_OK;
        }
    }
    enum status status = instance_count_event(instance, triggered, &step->events);
    if (status == STATUS_OK) {
        status = instance_update_modes(instance, triggered);
    }
    if (status == STATUS_OK && !(clock_difference(step->end, state->time) > 0.0)) {
        instance_note_handled_event(instance, end);
    }
    return status;
}

/* The modes at the beginning of a step, and how the integrator continues from there. */
static enum status begin_modes(struct step *step, enum continuation *continuation) {
    struct instance *instance = step->instance;
    struct instance_state *state = &instance->state;
    if (state->event_point == EVENT_UNHANDLED) {
        const enum status status = instance_handle_event(instance, &step->events);
        if (status != STATUS_OK) {
            return status;
        }
        *continuation =
            instance_continuation(instance, clock_difference(step->end, state->restart_time));
    }
    state->event_point = NO_EVENT;
    if (*continuation != CONTINUE_AFTER_CHANGE) {
        return STATUS_OK;
    }
    instance_begin_inputs(instance);
    return instance_update_modes(instance, NULL);
}

/* To the end of the present part of the step, or to a state event before it. */
static enum status move_part(struct step *step, enum continuation continuation) {
    struct instance *instance = step->instance;
    if (instance->integrator == NULL) {
        return STATUS_OK;
    }
    if (instance_is_at_rest(instance)) {
        return rest(step, continuation);
    }
    return continuation == CONTINUE_AFTER_EVENT && instance_steps_left(step) <= 0
               ? STATUS_TOO_MANY_STEPS
               : instance_move(step, continuation);
}

/* Writes the event to which the last part has come, and its time; false: there is none. */
static bool find_event(const struct step *step, bool has_moved, struct clock_time *time) {
    const struct instance *instance = step->instance;
    const size_t count = instance->model->events->indicator_count;
    const bool *triggered =
        has_moved && instance->integrator != NULL ? integrator_event(instance->integrator) : NULL;
    if (triggered == NULL && !step->meets_time_event) {
        return false;
    }
    memset(instance->triggered, 0, instance_event_size(instance->model));
    if (triggered != NULL) {
        memcpy(instance->triggered, triggered, count * sizeof *triggered);
        *time = clock_add(instance->state.restart_time, instance->state.latest_time);
    } else {
        instance->triggered[count] = true;
        *time = step->until;
    }
    return true;
}

/* At the end of the step, and no other time event is there. */
static bool is_done(struct step *step) {
    if (clock_difference(step->end, step->instance->state.time) > 0.0) {
        return false;
    }
    instance_set_part(step);
    return step->options->at_event != EVENTS_PASSED || !step->meets_time_event;
}

enum status instance_move_over_events(struct step *step, enum continuation continuation) {
    struct instance *instance = step->instance;
    enum status status = begin_modes(step, &continuation);
    while (status == STATUS_OK) {
        instance_set_part(step);
        const bool moves = clock_difference(step->until, instance->state.time) > 0.0;
        if (moves) {
            status = move_part(step, continuation);
        }
        struct clock_time time;
        if (status != STATUS_OK || !find_event(step, moves, &time)) {
            break;
        }
        status = meet_event(step, time);
        if (is_done(step)) {
            break;
        }
        continuation = CONTINUE_AFTER_EVENT;
    }
    return status;
}
