#include "stepping.h"

#include "event_point.h"
#include "fields.h"
#include "history.h"
#include "model_modes.h"
#include "right_hand_side.h"
#include "settings.h"
#include "snapshot_contents.h"

#include <limits.h>
#include <math.h>
#include <string.h>

static enum status refuse_times(const struct instance *instance, double t, double h) {
    const struct instance_experiment *experiment = &instance->state.experiment;
    const struct clock_time now = instance->state.time;
    if (!(h > 0.0) || !isfinite(t + h)) {
        message_write(&instance->sink, STATUS_INVALID_TIME,
                      "a step of %g s from t = %.17g is refused: a finite time and a step above 0 "
                      "are expected",
                      h, t);
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

static int saturated(int64_t count) {
    return count > INT_MAX ? INT_MAX : (int)count;
}

static void update_statistics(struct instance *instance) {
    struct instance_values *own = &instance->state.own;
    struct integrator_statistics *statistics = &instance->state.statistics;
    integrator_get_statistics(instance->integrator, statistics);
    own->solver_steps = saturated(statistics->steps);
    own->solver_rhs_evaluations = saturated(statistics->rhs_evaluations);
    own->solver_restarts = saturated(statistics->restarts);
    own->solver_failed_steps = saturated(statistics->failed_steps);
    own->solver_last_step = statistics->last_step;
    own->solver_last_order = statistics->last_order;
}

/* A step that is being done. */
struct step {
    struct instance *instance;
    const struct step_options *options;
    struct clock_time begin;
    struct clock_time end;          /* where it is to end; it may come forward */
    struct clock_time until;        /* end of its present part: that, or a time event before */
    bool meets_time_event;          /* at the end of its present part */
    bool is_early;                  /* it has come forward */
    bool is_over;                   /* the step is to end where it is */
    struct instance_snapshot *kept; /* the instance before the step; NULL: not needed so far */
    enum status answer;             /* of options->accept */
    int events;                     /* so far */
    int64_t steps_before;           /* internal ones, since initialization */
};

/* ---- Inputs --------------------------------------------------------------------------------- */

/* Those at the time of the instance, elapsed s after the beginning of the step. */
static void place_inputs(struct instance *instance, double elapsed) {
    struct instance_memory *memory = &instance->memory;
    double *u = doubles_of(memory->values, instance->model->inputs);
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        memory->current[i] = polynomial_shifted(&memory->pending[i], elapsed);
        u[i] = memory->current[i].d[0];
    }
}

/* Inputs at the end of a step of the length elapsed (s). Their derivatives applied to it only. */
static void end_inputs(struct instance *instance, double elapsed) {
    struct instance_memory *memory = &instance->memory;
    double *u = doubles_of(memory->values, instance->model->inputs);
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        struct polynomial *pending = &memory->pending[i];
        if (polynomial_moves(pending)) {
            memory->current[i] = polynomial_shifted(pending, elapsed);
            *pending = (struct polynomial){{pending->d[0]}};
        } else {
            memory->current[i] = *pending;
        }
        u[i] = memory->current[i].d[0];
    }
}

/* From now on the last value of an input is the one that was set for the end of the step; where the
 * step ended earlier, the value that the input has there. */
static void hold_last_nodes(const struct step *step) {
    const struct instance *instance = step->instance;
    const struct instance_memory *memory = &instance->memory;
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        const double *nodes = instance->nodes + i * POLYNOMIAL_NODES;
        memory->pending[i].d[0] =
            step->is_early ? memory->current[i].d[0] : nodes[POLYNOMIAL_NODES - 1];
    }
}

static enum status set_polynomials(struct instance *instance, double h) {
    struct instance_memory *memory = &instance->memory;
    double *u = doubles_of(memory->values, instance->model->inputs);
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        const struct polynomial input =
            polynomial_through(instance->nodes + i * POLYNOMIAL_NODES, h);
        for (int k = 0; k <= POLYNOMIAL_DEGREE; k++) {
            if (!isfinite(input.d[k])) {
                return instance_not_finite(instance, "a derivative of an input");
            }
        }
        memory->pending[i] = input;
        memory->current[i] = input;
        u[i] = input.d[0];
    }
    instance->outputs_are_valid = false;
    return STATUS_OK;
}

static enum status ask_inputs(const struct step *step, double t, double h) {
    struct instance *instance = step->instance;
    for (int k = 0; k < POLYNOMIAL_NODES; k++) {
        const double time =
            k == POLYNOMIAL_NODES - 1 ? step->end.s : t + k * (h / (POLYNOMIAL_NODES - 1));
        const enum status status = step->options->ask_inputs(step->options->context, time);
        if (status != STATUS_OK) {
            return status;
        }
        for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
            instance->nodes[i * POLYNOMIAL_NODES + (size_t)k] = instance->memory.pending[i].d[0];
        }
    }
    return set_polynomials(instance, clock_difference(step->end, step->begin));
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
    place_inputs(instance, clock_difference(instance->state.time, step->begin));
    return report(step);
}

static bool is_at_event(const struct instance *instance) {
    return instance->model->events != NULL && integrator_event(instance->integrator) != NULL;
}

/* Internal steps that the step may still take. */
static int64_t steps_left(const struct step *step) {
    const struct instance_state *state = &step->instance->state;
    return state->own.max_internal_steps - (state->statistics.steps - step->steps_before);
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
        const int64_t left = steps_left(step);
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

    // a step that ended early cannot be replayed: its end was not known when it began
    const bool is_whole = !step->is_early && !step->meets_time_event && !is_at_event(instance);
    state->has_history = status == STATUS_OK && is_whole && instance_longest_history(instance) > 0;
    state->passed_time = integrator_passed_time(instance->integrator);
    if (!state->has_history) {
        state->next_step = status == STATUS_OK ? integrator_next_step(instance->integrator) : 0.0;
    }
    update_statistics(instance);
    return status;
}

/* The same where no state moves: time passes until an input sets them free. */
static enum status rest(struct step *step, enum continuation continuation) {
    struct instance *instance = step->instance;
    struct instance_state *state = &instance->state;
    instance_hold(instance, step->end,
                  continuation == CONTINUE_AFTER_EVENT ? instance->memory.current
                                                       : instance->memory.pending);
    const struct integrator_start start = {
        .span = state->span,
        // inputs that are held leave the modes as they are
        .indicators = instance->inputs_move ? instance_describe_indicators(instance) : NULL,
    };
    state->next_step = 0.0;
    return integrator_rest(instance->integrator,
                           doubles_of(instance->memory.held, instance->model->states), &start,
                           clock_difference(step->until, state->restart_time), &state->latest_time);
}

/* The instance goes to the time of an event, and its modes change, unless the event is left. */
static enum status meet_event(struct step *step, struct clock_time time) {
    struct instance *instance = step->instance;
    struct instance_state *state = &instance->state;
    const bool *fired = instance->fired;
    const struct clock_time end = step->end;
    instance_set_clock(instance, time);
    place_inputs(instance, clock_difference(state->time, step->begin));
    instance->step_met_event = true;
    if (step->options->at_event != EVENTS_PASSED && state->time.s > step->begin.s) {
        step->is_early = clock_difference(end, state->time) > 0.0;
        step->end = state->time;
        if (step->options->at_event == EVENTS_LEFT) {
            instance_leave_event(instance, fired, end);
            return STATUS_OK;
        }
    }
    enum status status = instance_count_event(instance, fired, &step->events);
    if (status == STATUS_OK) {
        status = instance_update_modes(instance, fired);
    }
    if (status == STATUS_OK && !(clock_difference(step->end, state->time) > 0.0)) {
        instance_note_event(instance, end);
    }
    return status;
}

/* The modes at the beginning of a step, and how the integrator goes on from there. */
static enum status begin_modes(struct step *step, enum continuation *continuation) {
    struct instance *instance = step->instance;
    struct instance_state *state = &instance->state;
    if (state->event_point == EVENT_DUE) {
        const enum status status = instance_pass_due_event(instance, &step->events);
        if (status != STATUS_OK) {
            return status;
        }
        *continuation =
            instance_continuation(instance, clock_difference(step->end, state->restart_time));
    }
    state->event_point = NO_EVENT;
    return *continuation == CONTINUE_AFTER_CHANGE ? instance_update_modes(instance, NULL)
                                                  : STATUS_OK;
}

/* Sets the end of the next part of the step. A time event so little after the end of the step that
 * rounding may have put it there belongs to this step. */
static void set_part(struct step *step) {
    const double time = instance_next_time(step->instance);
    step->until = step->end;
    if (time == INFINITY) {
        step->meets_time_event = false;
        return;
    }
    const double h = clock_difference(step->end, step->begin);
    step->meets_time_event = time - step->end.s <= clock_slack(step->end.s, h);
    if (time < step->end.s) {
        step->until = (struct clock_time){.s = time};
    }
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
    return continuation == CONTINUE_AFTER_EVENT && steps_left(step) <= 0 ? STATUS_TOO_MANY_STEPS
                                                                         : move(step, continuation);
}

/* Writes the event to which the last part has come, and its time; false: there is none. */
static bool find_event(const struct step *step, bool has_moved, struct clock_time *time) {
    const struct instance *instance = step->instance;
    const size_t count = instance->model->events->indicator_count;
    const bool *fired =
        has_moved && instance->integrator != NULL ? integrator_event(instance->integrator) : NULL;
    *time = step->until;
    memset(instance->fired, 0, instance_event_size(instance->model));
    if (fired != NULL) {
        memcpy(instance->fired, fired, count * sizeof *fired);
        *time = clock_add(instance->state.restart_time, instance->state.latest_time);
    } else {
        instance->fired[count] = step->meets_time_event;
    }
    return fired != NULL || step->meets_time_event;
}

/* To step->end over all events on the way. */
static enum status move_over_events(struct step *step, enum continuation continuation) {
    struct instance *instance = step->instance;
    enum status status = begin_modes(step, &continuation);
    while (status == STATUS_OK) {
        set_part(step);
        const bool moves = clock_difference(step->until, instance->state.time) > 0.0;
        if (moves) {
            status = move_part(step, continuation);
        }
        struct clock_time time;
        if (status != STATUS_OK || !find_event(step, moves, &time)) {
            break;
        }
        status = meet_event(step, time);
        if (!(clock_difference(step->end, instance->state.time) > 0.0)) {
            break;
        }
        continuation = CONTINUE_AFTER_EVENT;
    }
    return status;
}

static enum status integrate(struct step *step) {
    struct instance *instance = step->instance;
    struct instance_state *state = &instance->state;
    const double target = clock_difference(step->end, state->restart_time);
    const enum continuation continuation = instance_continuation(instance, target);
    set_part(step);
    if (continuation == CONTINUE_NOW && !step->meets_time_event && interpolate(step, target)) {
        return STATUS_OK;
    }
    keep(step);
    const enum status status = instance->model->events == NULL
                                   ? move(step, continuation)
                                   : move_over_events(step, continuation);
    arrive(step,
           status == STATUS_OK ? step->end : clock_add(state->restart_time, state->latest_time));
    return status;
}

/* The same for a model without states. */
static enum status pass_time(struct step *step) {
    enum status status = STATUS_OK;
    if (step->instance->model->events != NULL) {
        keep(step);
        status = move_over_events(step, CONTINUE_AFTER_CHANGE);
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
        status = ask_inputs(step, communication_point, h);
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
        hold_last_nodes(step);
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
