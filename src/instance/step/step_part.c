#include "step.h"

#include "fields.h"

#include <string.h>

bool instance_report(struct step *step) {
    const double now = step->instance->state.time.s;
    double end = step->end.s;
    step->answer = step->options->accept(step->options->context, now, &end);
    if (step->answer != STATUS_OK || end < step->end.s) {
        step->is_over = step->answer != STATUS_OK ||
                        !(end - now > clock_rounding(instance_size_of_times(step->instance, now)));
        step->end = step->is_over ? step->instance->state.time : (struct clock_time){.s = end};
        step->is_early = true;
        if (clock_difference(step->until, step->end) > 0.0) {
            instance_set_part(step);
        }
        return true;
    }
    return false;
}

/* An integrator_observer. */
static bool observe(void *step_pointer, double t, const double x[]) {
    struct step *step = step_pointer;
    struct instance *instance = step->instance;
    memcpy(doubles_of(instance->memory.values, instance->model->states), x,
           instance->model->states.size);
    instance_set_clock(instance, clock_add(instance->state.restart_time, t));
    instance_evaluate_inputs(instance, clock_difference(instance->state.time, step->begin));
    return instance_report(step);
}

static bool is_at_event(const struct instance *instance) {
    return instance->model->events != NULL && integrator_event(instance->integrator) != NULL;
}

/* To step->until, which may become earlier on the way. */
static enum status advance(struct step *step) {
    struct instance *instance = step->instance;
    struct instance_state *state = &instance->state;
    double *x = doubles_of(instance->memory.values, instance->model->states);
    if (step->options->accept != NULL) {
        integrator_set_observer(instance->integrator, observe, step);
    }
    double target = clock_difference(step->until, state->restart_time);
    enum status status;
    for (;;) {
        const int64_t left = instance_steps_left(step);
        status = integrator_advance(instance->integrator, target, left > 1 ? left : 1,
                                    &state->latest_time, x);
        if (step->options->accept == NULL || status != STATUS_OK || step->is_over ||
            is_at_event(instance)) {
            break;
        }
        target = clock_difference(step->until, state->restart_time);
        if (!(state->latest_time < target)) {
            break;
        }
        // to the new end; the step that the observer cut short counts
        integrator_get_statistics(instance->integrator, &state->statistics);
    }
    if (step->options->accept != NULL) {
        integrator_set_observer(instance->integrator, NULL, NULL);
    }
    return status;
}

enum status instance_move(struct step *step, enum continuation continuation) {
    struct instance *instance = step->instance;
    struct instance_state *state = &instance->state;
    enum status status = instance_prepare_history(instance, step->end, continuation);
    if (status != STATUS_OK) {
        return status;
    }
    status = advance(step);
    if (status != STATUS_OK) {
        instance_set_clock(instance, clock_add(state->restart_time, state->latest_time));
    }

    // a step that ended early cannot be replayed: its end was not known when it began
    const bool is_whole = !step->is_early && !step->meets_time_event && !is_at_event(instance);
    state->has_history = status == STATUS_OK && is_whole && instance_longest_history(instance) > 0;
    state->passed_time = integrator_passed_time(instance->integrator);
    if (!state->has_history) {
        state->next_step = status == STATUS_OK ? integrator_next_step(instance->integrator) : 0.0;
    }
    integrator_get_statistics(instance->integrator, &state->statistics);
    instance_write_statistics(&state->statistics, &state->own);
    return status;
}
