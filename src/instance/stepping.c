#include "stepping.h"

#include "failures.h"
#include "history.h"
#include "modes.h"
#include "settings.h"
#include "snapshot.h"
#include "state.h"

#include <math.h>
#include <string.h>

struct step {
    struct instance *instance;
    const struct step_options *options;
    struct clock_time begin;
    struct clock_time end;   /* end of the step, which may become earlier */
    struct clock_time until; /* end of its current part: the same, or a time event before */
    bool meets_time_event;   /* true if a time event is at the end of the current part */
    double drift;            /* drift of the communication points up to the begin of the step, s */
    bool is_early;           /* true if `end` has become earlier */
    bool is_over;            /* true if the step ends where it is */
    struct instance_snapshot *kept; /* the instance before the step; NULL if not needed so far */
    enum status answer;             /* last status of options->accept */
    struct event_counts events;     /* events so far */
    int64_t steps_before; /* internal steps from initialization to the begin of the step */
    bool has_message;     /* true if a message has explained the failure of an event */
    bool is_stuck;        /* true if the integrator has failed */
};

/* ---- Times ---------------------------------------------------------------------------------- */

/* Latest time, s. Integrators go beyond the end of a step, by up to 1e4 times its length. With
 * times that then overflow cvode_bdf would try the same step without end. */
static const double latest_time = 1e300;

/* Refuses times that do not fit. mismatch: distance of communication_point from the time of the
 * instance, s. */
static enum status refuse_times(const struct instance *instance, double communication_point,
                                double step_size, double mismatch) {
    const struct instance_experiment *experiment = &instance->state.experiment;
    const double slack =
        clock_slack(instance_size_of_times(instance, communication_point), step_size);
    if (!(step_size > 0.0 && step_size <= latest_time &&
          fabs(communication_point) <= latest_time)) {
        message_write(
            &instance->sink, STATUS_INVALID_TIME,
            "a step of %g s from t = %.17g is refused: a time up to %g s and a step above "
            "0 are expected",
            step_size, communication_point, latest_time);
        return STATUS_INVALID_TIME;
    }
    if (communication_point + step_size == communication_point) {
        message_write(&instance->sink, STATUS_INVALID_TIME,
                      "a step of %g s from t = %.17g is refused: it does not change the time",
                      step_size, communication_point);
        return STATUS_INVALID_TIME;
    }
    if (!(fabs(mismatch) <= slack && mismatch + step_size > 0.0)) {
        message_write(&instance->sink, STATUS_INVALID_TIME,
                      "a step from t = %.17g is refused: the instance is at t = %.17g",
                      communication_point, instance->state.time.s);
        return STATUS_INVALID_TIME;
    }
    if (experiment->stop_time_defined &&
        communication_point + step_size - experiment->stop_time > slack) {
        message_write(&instance->sink, STATUS_INVALID_TIME,
                      "a step from t = %.17g to t = %.17g is refused: the stop time is %.17g",
                      communication_point, communication_point + step_size, experiment->stop_time);
        return STATUS_INVALID_TIME;
    }
    return STATUS_OK;
}

/* Sets the end of the next part of the step. A time event that differs from the end of the step by
 * no more than rounding is at the end, be it earlier or later. */
static void set_part(struct step *step) {
    const double time = instance_next_time(step->instance);
    step->until = step->end;
    step->meets_time_event = false;
    if (time == INFINITY) {
        return;
    }
    const double slack = clock_tick_slack(instance_size_of_times(step->instance, step->end.s),
                                          clock_difference(step->end, step->begin), step->drift);
    const double left = clock_difference(step->end, (struct clock_time){.s = time});
    step->meets_time_event = left >= -slack;
    if (left > slack) {
        const struct clock_time now = step->instance->state.time;
        step->until = time <= now.s ? now : (struct clock_time){.s = time};
    }
}

/* Returns the number of internal steps that the step may still take. */
static int64_t steps_left(const struct step *step) {
    const struct instance_state *state = &step->instance->state;
    return state->own.max_internal_steps - (state->statistics.steps - step->steps_before);
}

/* ---- Inputs --------------------------------------------------------------------------------- */

/* Sets the inputs to those at the beginning of a step. Until then, inputs have the values to which
 * the derivatives of the last step led. */
static void begin_inputs(struct instance *instance) {
    if (instance->inputs_are_held) {
        return;
    }
    struct instance_memory *memory = &instance->memory;
    double *u = doubles_of(memory->values, instance->model->inputs);
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        memory->current_inputs[i] = memory->next_inputs[i];
        u[i] = memory->next_inputs[i].d[0];
    }
}

/* Evaluates the inputs at the time of the instance, elapsed s after the beginning of the step. */
static void evaluate_inputs(struct instance *instance, double elapsed) {
    struct instance_memory *memory = &instance->memory;
    instance->inputs_are_held = false;
    double *u = doubles_of(memory->values, instance->model->inputs);
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        memory->current_inputs[i] = polynomial_shifted(&memory->next_inputs[i], elapsed);
        u[i] = memory->current_inputs[i].d[0];
    }
}

/* Sets the inputs after a step that has asked for them: they keep the value given for its end or,
 * if the step ended earlier, the value there. */
static void keep_last_nodes(const struct step *step) {
    struct instance *instance = step->instance;
    const struct instance_memory *memory = &instance->memory;
    instance->inputs_are_held = false;
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        const double *nodes = instance->nodes + i * POLYNOMIAL_NODES;
        memory->next_inputs[i].d[0] =
            step->is_early ? memory->current_inputs[i].d[0] : nodes[POLYNOMIAL_NODES - 1];
    }
}

static bool is_finite(const struct polynomial *polynomial) {
    bool found = true;
    for (int k = 0; k <= POLYNOMIAL_DEGREE; k++) {
        found &= isfinite(polynomial->d[k]) != 0;
    }
    return found;
}

/* Returns STATUS_NOT_FINITE, with a message, if the polynomial of an input overflows within the
 * step, which no integrator notices where derivatives of states do not depend on it. */
static enum status check_inputs(const struct step *step) {
    const struct instance *instance = step->instance;
    if (instance->inputs_are_held) {
        return STATUS_OK;
    }
    const double step_size = clock_difference(step->end, step->begin);
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        const struct polynomial *input = &instance->memory.next_inputs[i];
        if (polynomial_moves(input)) {
            const struct polynomial at_end = polynomial_shifted(input, step_size);
            if (!is_finite(&at_end)) {
                return instance_not_finite(instance, "an input at the end of the step");
            }
        }
    }
    return STATUS_OK;
}

static enum status set_polynomials(struct instance *instance, double step_size) {
    struct instance_memory *memory = &instance->memory;
    double *u = doubles_of(memory->values, instance->model->inputs);
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        const struct polynomial input =
            polynomial_through(instance->nodes + i * POLYNOMIAL_NODES, step_size);
        if (!is_finite(&input)) {
            return instance_not_finite(instance, "a derivative of an input");
        }
        memory->next_inputs[i] = input;
        memory->current_inputs[i] = input;
        u[i] = input.d[0];
    }
    instance->inputs_are_held = false;
    instance->outputs_are_valid = false;
    return STATUS_OK;
}

/* Sets the inputs of the step to polynomials through the values that the importer gives. */
static enum status ask_inputs(const struct step *step, double communication_point,
                              double step_size) {
    struct instance *instance = step->instance;
    for (int k = 0; k < POLYNOMIAL_NODES; k++) {
        const double time = k == POLYNOMIAL_NODES - 1
                                ? step->end.s
                                : communication_point + k * (step_size / (POLYNOMIAL_NODES - 1));
        const enum status status = step->options->ask_inputs(step->options->context, time);
        if (status != STATUS_OK) {
            return status;
        }
        for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
            instance->nodes[i * POLYNOMIAL_NODES + (size_t)k] =
                instance->memory.next_inputs[i].d[0];
        }
    }
    return set_polynomials(instance, clock_difference(step->end, step->begin));
}

/* Sets the inputs to their values at the end of a step. Their derivatives applied to it only. */
static void end_inputs(const struct step *step) {
    struct instance *instance = step->instance;
    const double elapsed = clock_difference(instance->state.time, step->begin);
    struct instance_memory *memory = &instance->memory;
    double *u = doubles_of(memory->values, instance->model->inputs);
    instance->inputs_are_held = true;
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        struct polynomial *next = &memory->next_inputs[i];
        if (polynomial_moves(next)) {
            memory->current_inputs[i] = polynomial_shifted(next, elapsed);
            *next = (struct polynomial){{next->d[0]}};
            instance->inputs_are_held = false;
        } else {
            memory->current_inputs[i] = *next;
        }
        u[i] = memory->current_inputs[i].d[0];
    }
}

/* ---- Parts without an event ----------------------------------------------------------------- */

/* Reports the time of the instance to options->accept. Returns true if the step will end earlier.
 */
static bool report(struct step *step) {
    const double now = step->instance->state.time.s;
    double end = step->end.s;
    step->answer = step->options->accept(step->options->context, now, &end);
    if (step->answer != STATUS_OK || end < step->end.s) {
        step->is_over = step->answer != STATUS_OK ||
                        !(end - now > clock_rounding(instance_size_of_times(step->instance, now)));
        step->end = step->is_over ? step->instance->state.time : (struct clock_time){.s = end};
        step->is_early = true;
        if (clock_difference(step->until, step->end) > 0.0) {
            set_part(step);
        }
        return true;
    }
    return false;
}

/* Observes an internal step: an integrator_observer. */
static bool observe(void *step_pointer, double t, const double x[]) {
    struct step *step = step_pointer;
    struct instance *instance = step->instance;
    memcpy(doubles_of(instance->memory.values, instance->model->states), x,
           instance->model->states.size);
    instance_set_clock(instance, clock_add(instance->state.restart_time, t));
    evaluate_inputs(instance, clock_difference(instance->state.time, step->begin));
    return report(step);
}

static bool is_at_event(const struct instance *instance) {
    return instance->model->events != NULL && integrator_event(instance->integrator) != NULL;
}

/* Advances to step->until, which may become earlier on the way. */
static enum status advance(struct step *step) {
    struct instance *instance = step->instance;
    const struct instance_state *state = &instance->state;
    if (step->options->accept == NULL) {
        return instance_advance(instance, step->until, steps_left(step));
    }
    integrator_set_observer(instance->integrator, observe, step);
    enum status status = STATUS_OK;
    bool is_short = true; // of step->until: the observer has cut an internal step short
    while (is_short) {
        status = instance_advance(instance, step->until, steps_left(step));
        is_short = status == STATUS_OK && !step->is_over && !is_at_event(instance) &&
                   state->latest_time < clock_difference(step->until, state->restart_time);
    }
    integrator_set_observer(instance->integrator, NULL, NULL);
    return status;
}

/* Advances to step->until, or to an earlier state event. Both may become earlier on the way. */
static enum status move(struct step *step, enum continuation continuation) {
    struct instance *instance = step->instance;
    enum status status = instance_prepare_history(instance, step->end, continuation);
    if (status != STATUS_OK) {
        return status;
    }
    status = advance(step);
    step->is_stuck = status != STATUS_OK;
    // a step that ended early cannot be replayed: its end was not known when it began
    instance_note_part(instance, status,
                       !step->is_early && !step->meets_time_event && !is_at_event(instance));
    return status;
}

/* ---- Events --------------------------------------------------------------------------------- */

/* Ends a step that would have lasted until `end` at the present time, at which these indicators
 * fall to 0. The event stays unhandled. */
static void leave_event(struct instance *instance, const bool triggered[], struct clock_time end) {
    memcpy(instance->memory.unhandled, triggered, instance_event_size(instance->model));
    instance->state.event_point = EVENT_UNHANDLED;
    instance->state.cut_end = end;
}

/* Notes that the event at the present time, before `end`, has been handled. */
static void note_handled_event(struct instance *instance, struct clock_time end) {
    instance->state.event_point = EVENT_HANDLED;
    instance->state.cut_end = end;
}

/* Moves the instance to the time of an event and handles it, unless the step ends there. */
static enum status meet_event(struct step *step, struct clock_time time) {
    struct instance *instance = step->instance;
    struct instance_state *state = &instance->state;
    const bool *triggered = instance->triggered;
    const struct clock_time end = step->end;
    instance_set_clock(instance, time);
    evaluate_inputs(instance, clock_difference(state->time, step->begin));
    instance->step_met_event = true;
    if (step->options->at_event != EVENTS_PASSED && state->time.s > step->begin.s) {
        step->is_early = clock_difference(end, state->time) > 0.0;
        step->end = state->time;
        if (step->options->at_event == EVENTS_LEFT) {
            leave_event(instance, triggered, end);
            return STATUS_OK;
        }
    }
    enum status status = instance_count_event(instance, triggered, &step->events);
    if (status == STATUS_OK) {
        status = instance_update_modes(instance, triggered);
    }
    step->has_message = status != STATUS_OK;
    if (status == STATUS_OK && !(clock_difference(step->end, state->time) > 0.0)) {
        note_handled_event(instance, end);
    }
    return status;
}

/* Decides the modes at the beginning of a step, and how the integrator continues from there. */
static enum status begin_modes(struct step *step, enum continuation *continuation) {
    struct instance *instance = step->instance;
    struct instance_state *state = &instance->state;
    if (state->event_point == EVENT_UNHANDLED) {
        const enum status status = instance_handle_event(instance, &step->events);
        if (status != STATUS_OK) {
            step->has_message = true;
            return status;
        }
        *continuation =
            instance_continuation(instance, clock_difference(step->end, state->restart_time));
    }
    state->event_point = NO_EVENT;
    if (*continuation != CONTINUE_AFTER_CHANGE) {
        return STATUS_OK;
    }
    begin_inputs(instance);
    const enum status status = instance_update_modes(instance, NULL);
    step->has_message = status != STATUS_OK;
    return status;
}

/* True if every state's derivative is 0 in the current modes, or there are no states. */
static bool is_at_rest(const struct instance *instance) {
    const struct model_events *events = instance->model->events;
    return instance->model->states.size == 0 || (events != NULL && events->is_at_rest != NULL &&
                                                 events->is_at_rest(instance->memory.values));
}

/* Advances to the end of the current part of the step, or to an earlier state event. */
static enum status move_part(struct step *step, enum continuation continuation) {
    struct instance *instance = step->instance;
    if (instance->integrator == NULL) {
        return STATUS_OK;
    }
    if (is_at_rest(instance)) {
        return instance_rest(instance, step->end, step->until, step->meets_time_event,
                             continuation);
    }
    return continuation == CONTINUE_AFTER_EVENT && steps_left(step) <= 0 ? STATUS_TOO_MANY_STEPS
                                                                         : move(step, continuation);
}

/* Writes the event at which the last part ended, and its time. Returns false if there is none. */
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

/* True at the end of the step, if no other time event is there. */
static bool is_done(const struct step *step) {
    return !(clock_difference(step->end, step->instance->state.time) > 0.0) &&
           (step->options->at_event != EVENTS_PASSED || !step->meets_time_event);
}

/* Advances to step->end over all events on the way. */
static enum status move_over_events(struct step *step, enum continuation continuation) {
    struct instance *instance = step->instance;
    enum status status = begin_modes(step, &continuation);
    set_part(step);
    while (status == STATUS_OK) {
        const bool moves = clock_difference(step->until, instance->state.time) > 0.0;
        if (moves) {
            status = move_part(step, continuation);
        }
        struct clock_time time;
        if (status != STATUS_OK || !find_event(step, moves, &time)) {
            break;
        }
        status = meet_event(step, time);
        set_part(step);
        if (is_done(step)) {
            break;
        }
        continuation = CONTINUE_AFTER_EVENT;
    }
    return status;
}

/* ---- Steps ---------------------------------------------------------------------------------- */

static void keep(struct step *step) {
    if (step->options->undo != NULL && step->kept == NULL) {
        step->kept = step->options->undo;
        instance_keep(step->instance, step->kept);
    }
}

/* Sets the instance to the time at which the step has ended. */
static void end_at(const struct step *step, struct clock_time time) {
    instance_set_clock(step->instance, time);
    if (!step->instance->inputs_are_held) {
        end_inputs(step);
    }
}

static enum status integrate(struct step *step) {
    struct instance *instance = step->instance;
    struct instance_state *state = &instance->state;
    const double target = clock_difference(step->end, state->restart_time);
    set_part(step);
    const enum continuation continuation = instance_continuation(instance, target);
    if (continuation == CONTINUE_NOW && !step->meets_time_event &&
        instance_interpolate(instance, target)) {
        end_at(step, step->end);
        return STATUS_OK;
    }
    keep(step);
    const enum status status = instance->model->events == NULL
                                   ? move(step, continuation)
                                   : move_over_events(step, continuation);
    end_at(step, status == STATUS_OK ? step->end : state->time);
    return status;
}

/* Lets the time pass for a model without states. */
static enum status pass_time(struct step *step) {
    enum status status = STATUS_OK;
    if (step->instance->model->events != NULL) {
        keep(step);
        status = move_over_events(step, CONTINUE_AFTER_CHANGE);
    }
    end_at(step, status == STATUS_OK ? step->end : step->instance->state.time);
    return status;
}

/* Sends the message about a step that has failed, unless it has been sent. */
static void explain(const struct step *step, double communication_point, enum status status) {
    struct instance *instance = step->instance;
    struct explanation why = {.length = 0};
    if (step->has_message || instance->sink.write == NULL) {
        return;
    }
    if (step->is_stuck) {
        instance_explain_step(instance, status, &why);
    }
    message_write(&instance->sink, status,
                  "the step from t = %.17g to t = %.17g ended at %.17g: %s", communication_point,
                  step->end.s, instance->state.time.s,
                  why.length > 0 ? why.text : status_text(status));
}

static enum status do_step(struct step *step, double communication_point, double step_size) {
    struct instance *instance = step->instance;
    enum status status = STATUS_OK;
    if (step->options->ask_inputs != NULL) {
        instance->inputs_are_held = false;
        keep(step);
        status = ask_inputs(step, communication_point, step_size);
        if (status != STATUS_OK) {
            return status;
        }
    }
    status = check_inputs(step);
    if (status == STATUS_OK) {
        status = instance->model->states.size == 0 ? pass_time(step) : integrate(step);
    }
    if (status != STATUS_OK) {
        explain(step, communication_point, status);
        return status;
    }
    if (step->options->ask_inputs != NULL) {
        keep_last_nodes(step);
    }
    const bool ends_at_event = instance->state.event_point != NO_EVENT;
    if (step->options->accept != NULL && (!step->is_early || ends_at_event)) {
        (void)report(step);
    }
    return step->answer;
}

/* Returns the end of a step after an event: the end of the step that the event cut short, if the
 * importer means the same time. Its own differences of times have rounding errors. */
static struct clock_time resumed_end(const struct instance *instance, struct clock_time end) {
    const struct instance_state *state = &instance->state;
    const double difference = clock_difference(end, state->cut_end);
    const double rounding = clock_rounding(instance_size_of_times(instance, end.s));
    return fabs(difference) <= rounding ? state->cut_end : end;
}

enum status instance_do_step_with(struct instance *instance, double communication_point,
                                  double step_size, const struct step_options *options) {
    const double mismatch =
        clock_difference((struct clock_time){.s = communication_point}, instance->state.time);
    enum status status = refuse_times(instance, communication_point, step_size, mismatch);
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
        .drift = instance->state.drift +
                 clock_step_drift(instance_size_of_times(instance, communication_point), mismatch),
        .answer = STATUS_OK,
        .steps_before = instance->state.statistics.steps,
    };
    if (instance->state.event_point != NO_EVENT) {
        step.end = resumed_end(instance, step.end);
    }
    instance->step_met_event = false;
    status = do_step(&step, communication_point, step_size);
    if (step.kept != NULL && status_severity(status) == SEVERITY_DISCARD) {
        const enum status restored = instance_undo(instance, step.kept);
        return restored == STATUS_OK ? status : restored;
    }
    instance->state.drift = step.drift;
    return status;
}

enum status instance_do_step(struct instance *instance, double communication_point,
                             double step_size) {
    static const struct step_options none = {0};
    return instance_do_step_with(instance, communication_point, step_size, &none);
}

bool instance_met_event(const struct instance *instance) {
    return instance->step_met_event;
}
