#include "stepping.h"

#include "event_point.h"
#include "fields.h"
#include "right_hand_side.h"
#include "settings.h"
#include "snapshot_contents.h"
#include "step.h"

#include <math.h>
#include <string.h>

/* s: integrators go beyond the end of a step, by up to 1e4 times its length. With times that then
 * overflow cvode_bdf would try the same step without end. */
static const double latest_time = 1e300;

static enum status refuse_times(const struct instance *instance, double t, double h) {
    const struct instance_experiment *experiment = &instance->state.experiment;
    const struct clock_time now = instance->state.time;
    if (!(h > 0.0 && h <= latest_time && fabs(t) <= latest_time)) {
        message_write(
            &instance->sink, STATUS_INVALID_TIME,
            "a step of %g s from t = %.17g is refused: a time up to %g s and a step above "
            "0 are expected",
            h, t, latest_time);
        return STATUS_INVALID_TIME;
    }
    if (t + h == t) {
        message_write(&instance->sink, STATUS_INVALID_TIME,
                      "a step of %g s from t = %.17g is refused: it does not change the time", h,
                      t);
        return STATUS_INVALID_TIME;
    }
    const double mismatch = clock_difference((struct clock_time){.s = t}, now);
    const bool is_there = fabs(mismatch) <= clock_spacing(t) || fabs(mismatch) <= clock_slack(t, h);
    if (!is_there || !(mismatch + h > 0.0)) {
        message_write(&instance->sink, STATUS_INVALID_TIME,
                      "a step from t = %.17g is refused: the instance is at t = %.17g", t, now.s);
        return STATUS_INVALID_TIME;
    }
    if (experiment->stop_time_defined && t + h - experiment->stop_time > clock_slack(t + h, h)) {
        message_write(&instance->sink, STATUS_INVALID_TIME,
                      "a step from t = %.17g to t = %.17g is refused: the stop time is %.17g", t,
                      t + h, experiment->stop_time);
        return STATUS_INVALID_TIME;
    }
    return STATUS_OK;
}

/* ---- Inputs --------------------------------------------------------------------------------- */

/* Inputs at the end of a step of the length elapsed (s). Their derivatives applied to it only. */
static void end_inputs(struct instance *instance, double elapsed) {
    struct instance_memory *memory = &instance->memory;
    double *u = doubles_of(memory->values, instance->model->inputs);
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        struct polynomial *next = &memory->next_inputs[i];
        if (polynomial_moves(next)) {
            memory->current_inputs[i] = polynomial_shifted(next, elapsed);
            *next = (struct polynomial){{next->d[0]}};
        } else {
            memory->current_inputs[i] = *next;
        }
        u[i] = memory->current_inputs[i].d[0];
    }
}

/* ---- Integration ---------------------------------------------------------------------------- */

static void keep(struct step *step) {
    if (step->options->undo != NULL && step->kept == NULL) {
        step->kept = step->options->undo;
        instance_keep(step->instance, step->kept);
    }
}

/* Reports the time of the instance; true: the step is to end there, or before the end so far. */
static bool report(struct step *step) {
    const double now = step->instance->state.time.s;
    double end = step->end.s;
    step->answer = step->options->accept(step->options->context, now, &end);
    if (step->answer != STATUS_OK || end < step->end.s) {
        step->is_over = step->answer != STATUS_OK || !(end - now > clock_slack(now, end - now));
        step->end = step->is_over ? step->instance->state.time : (struct clock_time){.s = end};
        step->is_early = true;
        if (clock_difference(step->until, step->end) > 0.0) {
            step->until = step->end;
            step->meets_time_event = false;
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
    return report(step);
}

static bool is_at_event(const struct instance *instance) {
    return instance->model->events != NULL && integrator_event(instance->integrator) != NULL;
}

/* To step->until, which may come forward on the way. */
ALWAYS_INLINE enum status advance(struct step *step) {
    struct instance *instance = step->instance;
    struct instance_state *state = &instance->state;
    double *x = doubles_of(instance->memory.values, instance->model->states);
    if (step->options->accept != NULL) {
        integrator_set_observer(instance->integrator, observe, step);
    }
    enum status status;
    for (;;) {
        const int64_t left = instance_steps_left(step);
        status = integrator_advance(instance->integrator,
                                    clock_difference(step->until, state->restart_time),
                                    left > 1 ? left : 1, &state->latest_time, x);
        if (status != STATUS_OK || step->is_over || is_at_event(instance) ||
            !(state->latest_time < clock_difference(step->until, state->restart_time))) {
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

/* The instance is at the time where the step has ended. */
static void arrive(const struct step *step, struct clock_time time) {
    instance_set_clock(step->instance, time);
    end_inputs(step->instance, clock_difference(time, step->begin));
}

/* To a point that an internal step may have passed already: then nothing can fail, and nothing is
 * counted. Otherwise false. */
static bool interpolate(const struct step *step, double target) {
    struct instance *instance = step->instance;
    if (!integrator_interpolate(instance->integrator, target,
                                doubles_of(instance->memory.values, instance->model->states))) {
        return false;
    }
    instance->state.latest_time = target;
    arrive(step, step->end);
    return true;
}

/* To step->until, or to an event before it. */
ALWAYS_INLINE enum status move(struct step *step, enum continuation continuation) {
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

enum status instance_move(struct step *step, enum continuation continuation) {
    return move(step, continuation);
}

static enum status integrate(struct step *step) {
    struct instance *instance = step->instance;
    struct instance_state *state = &instance->state;
    const double target = clock_difference(step->end, state->restart_time);
    const enum continuation continuation = instance_continuation(instance, target);
    instance_set_part(step);
    if (continuation == CONTINUE_NOW && !step->meets_time_event && interpolate(step, target)) {
        return STATUS_OK;
    }
    keep(step);
    const enum status status = instance->model->events == NULL
                                   ? move(step, continuation)
                                   : instance_move_over_events(step, continuation);
    arrive(step, status == STATUS_OK ? step->end : state->time);
    return status;
}

/* The same for a model without states. */
static enum status pass_time(struct step *step) {
    enum status status = instance_check_inputs(step);
    if (status != STATUS_OK) {
        return status;
    }
    if (step->instance->model->events != NULL) {
        keep(step);
        status = instance_move_over_events(step, CONTINUE_AFTER_CHANGE);
    }
    arrive(step, status == STATUS_OK ? step->end : step->instance->state.time);
    return status;
}

/* ---- Steps ---------------------------------------------------------------------------------- */

static enum status do_step(struct step *step, double communication_point, double h) {
    struct instance *instance = step->instance;
    enum status status = STATUS_OK;
    if (step->options->ask_inputs != NULL) {
        keep(step);
        status = instance_ask_inputs(step, communication_point, h);
        if (status != STATUS_OK) {
            return status;
        }
    }
    status = instance->integrator == NULL ? pass_time(step) : integrate(step);
    if (status == STATUS_TOO_MANY_EVENTS) {
        return status; // the message has been sent
    }
    if (status != STATUS_OK) {
        message_write(
            &instance->sink, status, "the step from t = %.17g to t = %.17g ended at %.17g: %s",
            communication_point, step->end.s, instance->state.time.s, status_text(status));
        return status;
    }
    if (step->options->ask_inputs != NULL) {
        instance_hold_last_nodes(step);
    }
    const bool ends_at_event = instance->state.event_point != NO_EVENT;
    if (step->options->accept != NULL && (!step->is_early || ends_at_event)) {
        (void)report(step);
    }
    return step->answer;
}

enum status instance_do_step_with(struct instance *instance, double communication_point,
                                  double step_size, const struct step_options *options) {
    enum status status = refuse_times(instance, communication_point, step_size);
    if (status == STATUS_OK) {
        status = instance_check_parameters(instance);
    }
    if (status != STATUS_OK) {
        return status;
    }
    struct step step = {
        .instance = instance,
        .options = options,
        .begin = instance->state.time,
        .end = clock_add((struct clock_time){.s = communication_point}, step_size),
        .answer = STATUS_OK,
        .steps_before = instance->state.statistics.steps,
    };
    if (instance->state.event_point != NO_EVENT) {
        step.end = instance_resumed_end(instance, step.end);
    }
    instance->step_met_event = false;
    status = do_step(&step, communication_point, step_size);
    if (step.kept != NULL && status_severity(status) == SEVERITY_DISCARD) {
        const enum status restored = instance_undo(instance, step.kept);
        return restored == STATUS_OK ? status : restored;
    }
    return status;
}

enum status instance_do_step(struct instance *instance, double communication_point, double step) {
    static const struct step_options none = {0};
    return instance_do_step_with(instance, communication_point, step, &none);
}

bool instance_met_event(const struct instance *instance) {
    return instance->step_met_event;
}
