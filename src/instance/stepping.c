#include "stepping.h"

#include "failures.h"
#include "history.h"
#include "modes.h"
#include "snapshot.h"
#include "state.h"

#include <math.h>
#include <string.h>

struct step {
    struct instance *instance;
    const struct step_options *options;
    double communication_point; /* s */
    struct clock_time begin;
    struct clock_time end;   /* end of the step, which may become earlier */
    struct clock_time until; /* end of its current part: the same, or a time event before */
    bool meets_time_event;   /* true if a time event is at the end of the current part */
    const bool *triggered;   /* state event at which the last part has ended, a flag per indicator;
                                NULL if it has ended otherwise */
    double drift;            /* drift of the communication points up to the begin of the step, s */
    bool is_early;           /* true if `end` has become earlier */
    bool is_over;            /* true if the step ends where it is */
    bool has_ended;          /* true if an event has ended the simulation */
    bool is_kept;            /* true if options->undo has the instance before the step */
    enum status answer;      /* last status of options->accept */
    struct event_counts events; /* events so far */
    int64_t steps_before;       /* internal steps from initialization to the begin of the step */
    bool has_message;           /* true if a message has explained the failure */
    bool has_touched;           /* true if a mode has ended at the time `touched` */
    struct clock_time touched;
    bool is_stuck; /* true if the integrator has failed */
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

/* Sets the inputs to their values elapsed s after the beginning of the step. Until the first time,
 * inputs have the values to which the derivatives of the last step led. */
static void move_inputs(struct instance *instance, double elapsed) {
    struct instance_memory *memory = &instance->memory;
    double *u = doubles_of(memory->values, instance->model->inputs);
    const size_t count = instance->inputs_are_held ? 0 : count_of(instance->model->inputs);
    for (size_t i = 0; i < count; i++) {
        const struct polynomial *next = &memory->next_inputs[i];
        memory->current_inputs[i] =
            elapsed > 0.0 && polynomial_moves(next) ? polynomial_shifted(next, elapsed) : *next;
        u[i] = memory->current_inputs[i].d[0];
    }
}

/* Sets the inputs to their values at the end of a step. Their derivatives applied to it only. */
static void end_inputs(const struct step *step) {
    struct instance *instance = step->instance;
    const size_t count = count_of(instance->model->inputs);
    move_inputs(instance, clock_difference(instance->state.time, step->begin));
    instance->inputs_are_held = true;
    for (size_t i = 0; i < count; i++) {
        struct polynomial *next = &instance->memory.next_inputs[i];
        if (polynomial_moves(next)) {
            *next = (struct polynomial){{next->d[0]}};
            instance->inputs_are_held = false;
        }
    }
}

/* Sets the inputs after a step that has asked for them: they keep the value given for its end or,
 * if the step ended earlier, the value there. */
static void keep_last_nodes(const struct step *step) {
    struct instance *instance = step->instance;
    const struct instance_memory *memory = &instance->memory;
    instance->inputs_are_held = false;
    const size_t count = count_of(instance->model->inputs);
    for (size_t i = 0; i < count; i++) {
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
    const size_t count = count_of(instance->model->inputs);
    for (size_t i = 0; i < count; i++) {
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

/* Sets the inputs of the step to polynomials through the values that the importer gives. */
static enum status ask_inputs(const struct step *step, double step_size) {
    struct instance *instance = step->instance;
    struct instance_memory *memory = &instance->memory;
    const size_t count = count_of(instance->model->inputs);
    for (int k = 0; k < POLYNOMIAL_NODES; k++) {
        const double time =
            k == POLYNOMIAL_NODES - 1
                ? step->end.s
                : step->communication_point + k * (step_size / (POLYNOMIAL_NODES - 1));
        const enum status status = step->options->ask_inputs(step->options->context, time);
        if (status != STATUS_OK) {
            return status;
        }
        for (size_t i = 0; i < count; i++) {
            instance->nodes[i * POLYNOMIAL_NODES + (size_t)k] = memory->next_inputs[i].d[0];
        }
    }
    double *u = doubles_of(memory->values, instance->model->inputs);
    for (size_t i = 0; i < count; i++) {
        const struct polynomial input = polynomial_through(
            instance->nodes + i * POLYNOMIAL_NODES, clock_difference(step->end, step->begin));
        if (!is_finite(&input)) {
            return instance_not_finite(instance, "a derivative of an input");
        }
        memory->next_inputs[i] = input;
        memory->current_inputs[i] = input;
        u[i] = input.d[0];
    }
    instance->outputs_are_valid = false;
    return STATUS_OK;
}

/* ---- Integration ---------------------------------------------------------------------------- */

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
    move_inputs(instance, clock_difference(instance->state.time, step->begin));
    return report(step);
}

/* Advances the prepared integrator to step->until, or to a state event before. */
static enum status advance(struct step *step) {
    struct instance *instance = step->instance;
    struct instance_state *state = &instance->state;
    const int64_t left = steps_left(step);
    const enum status status =
        integrator_advance(instance->integrator, clock_difference(step->until, state->restart_time),
                           left > 1 ? left : 1, &state->latest_time,
                           doubles_of(instance->memory.values, instance->model->states));
    state->statistics = *integrator_totals(instance->integrator);
    instance_take_anchors(instance);
    step->triggered =
        instance->model->events != NULL ? integrator_event(instance->integrator) : NULL;
    return status;
}

/* Does the same while the importer observes each internal step and may end the step earlier. */
static enum status advance_observed(struct step *step) {
    const struct instance_state *state = &step->instance->state;
    enum status status = STATUS_OK;
    bool is_short = true; // of step->until: the observer has cut an internal step short
    integrator_set_observer(step->instance->integrator, observe, step);
    while (is_short) {
        status = advance(step);
        is_short = status == STATUS_OK && !step->is_over && step->triggered == NULL &&
                   state->latest_time < clock_difference(step->until, state->restart_time);
    }
    integrator_set_observer(step->instance->integrator, NULL, NULL);
    return status;
}

/* True if every state's derivative is 0 in the current modes, or there are no states. */
static bool is_at_rest(const struct instance *instance) {
    const struct model_events *events = instance->model->events;
    return instance->model->states.size == 0 || (events != NULL && events->is_at_rest != NULL &&
                                                 events->is_at_rest(instance->memory.values));
}

/* True if the advance has ended where a mode has no solution beyond its limit: that is an event,
 * once at any time. */
static bool ends_at_limit(struct step *step) {
    const struct instance_state *state = &step->instance->state;
    const struct clock_time now = clock_add(state->restart_time, state->latest_time);
    const bool is_again = step->has_touched && clock_difference(now, step->touched) == 0.0;
    step->has_touched = true;
    step->touched = now;
    if (is_again || !integrator_touches(step->instance->integrator)) {
        return false;
    }
    step->triggered = integrator_event(step->instance->integrator);
    return true;
}

/* Advances by the restarts that anchors need. */
static enum status advance_by_restarts(struct step *step) {
    struct instance *instance = step->instance;
    const struct instance_state *state = &instance->state;
    for (;;) {
        const enum status status =
            step->options->accept == NULL ? advance(step) : advance_observed(step);
        const bool may_be_lost = status == STATUS_NOT_FINITE || status == STATUS_NO_CONVERGENCE;
        if (!may_be_lost || !instance->ode.may_end) {
            return status;
        }
        if (instance->model->anchor == NULL || state->latest_time <= 0.0) {
            return ends_at_limit(step) ? STATUS_OK : status;
        }
        if (steps_left(step) <= 0) {
            return STATUS_TOO_MANY_STEPS;
        }
        instance_note_part(instance, status, false); // moves the instance there
        move_inputs(instance, clock_difference(state->time, step->begin));
        const enum status restarted =
            instance_prepare_history(instance, step->end, CONTINUE_AFTER_EVENT);
        if (restarted != STATUS_OK) {
            return restarted;
        }
    }
}

/* Integrates to step->until, or to a state event before, which it writes to step->triggered. */
static enum status integrate(struct step *step, enum continuation continuation) {
    struct instance *instance = step->instance;
    const double way = clock_difference(step->until, instance->state.time);
    step->triggered = NULL;
    if (instance->integrator == NULL || !(way > 0.0)) {
        return STATUS_OK;
    }
    enum status status;
    if (is_at_rest(instance)) {
        status =
            instance_rest(instance, step->end, step->until, step->meets_time_event, continuation);
        step->triggered = integrator_event(instance->integrator);
        return status;
    }
    if (continuation == CONTINUE_AFTER_EVENT && steps_left(step) <= 0) {
        return STATUS_TOO_MANY_STEPS;
    }
    status = instance_prepare_history(instance, step->end, continuation);
    if (status != STATUS_OK) {
        return status;
    }
    status = advance_by_restarts(step);
    step->is_stuck = status != STATUS_OK;
    // a step that ended early cannot be replayed: its end was not known when it began
    instance_note_part(instance, status,
                       !step->is_early && !step->meets_time_event && step->triggered == NULL);
    return status;
}

/* ---- Events --------------------------------------------------------------------------------- */

/* Ends the step at the present time if an event has ended the simulation. */
static void end_with_simulation(struct step *step) {
    const struct clock_time now = step->instance->state.time;
    step->has_ended = instance_has_ended(step->instance);
    if (step->has_ended && clock_difference(step->end, now) > 0.0) {
        step->is_early = true;
        step->end = now;
    }
}

/* Decides the modes at the beginning of a step, and how the integrator continues from there. */
static enum status begin_modes(struct step *step, enum continuation *continuation) {
    struct instance *instance = step->instance;
    struct instance_state *state = &instance->state;
    enum status status = STATUS_OK;
    if (instance->model->events == NULL) {
        return STATUS_OK;
    }
    if (state->event_point == EVENT_UNHANDLED) {
        status = instance_handle_event(instance, &step->events);
        *continuation =
            instance_continuation(instance, clock_difference(step->end, state->restart_time));
    }
    if (status == STATUS_OK) {
        state->event_point = NO_EVENT;
        if (*continuation == CONTINUE_AFTER_CHANGE) {
            move_inputs(instance, 0.0);
            status = instance_update_modes(instance, NULL);
        }
    }
    step->has_message = status != STATUS_OK;
    end_with_simulation(step);
    set_part(step);
    return status;
}

/* Writes which event it is at which the last part has ended, and moves the instance there. */
static void move_to_event(struct step *step) {
    struct instance *instance = step->instance;
    const struct instance_state *state = &instance->state;
    const size_t count = instance->model->events->indicator_count;
    struct clock_time time = step->until;
    memset(instance->triggered, 0, instance_event_size(instance->model));
    if (step->triggered != NULL) {
        memcpy(instance->triggered, step->triggered, count * sizeof *step->triggered);
        time = clock_add(state->restart_time, state->latest_time);
    } else {
        instance->triggered[count] = true;
    }
    instance_set_clock(instance, time);
    move_inputs(instance, clock_difference(time, step->begin));
    instance->step_met_event = true;
}

/* Handles the event at the present time. If the importer wants it, the step ends here, and the
 * event may stay unhandled. */
static enum status handle_event(struct step *step) {
    struct instance *instance = step->instance;
    struct instance_state *state = &instance->state;
    const struct clock_time end = step->end; // without the event
    if (step->options->at_event != EVENTS_PASSED && state->time.s > step->begin.s) {
        step->is_early = clock_difference(end, state->time) > 0.0;
        step->end = state->time;
        if (step->options->at_event == EVENTS_LEFT) {
            memcpy(instance->memory.unhandled, instance->triggered,
                   instance_event_size(instance->model));
            state->event_point = EVENT_UNHANDLED;
            state->cut_end = end;
            return STATUS_OK;
        }
    }
    enum status status = instance_count_event(instance, instance->triggered, &step->events);
    if (status == STATUS_OK) {
        status = instance_update_modes(instance, instance->triggered);
    }
    step->has_message = status != STATUS_OK;
    end_with_simulation(step);
    if (status == STATUS_OK && !(clock_difference(step->end, state->time) > 0.0)) {
        state->event_point = EVENT_HANDLED;
        state->cut_end = end;
    }
    return status;
}

/* True at the end of the step, if no other time event is there. */
static bool is_done(const struct step *step) {
    return step->has_ended ||
           (!(clock_difference(step->end, step->instance->state.time) > 0.0) &&
            (step->options->at_event != EVENTS_PASSED || !step->meets_time_event));
}

/* ---- Begin and end -------------------------------------------------------------------------- */

/* Returns the end of a step after an event: the end of the step that the event cut short, if the
 * importer means the same time. Its own differences of times have rounding errors. */
static struct clock_time resumed_end(const struct instance *instance, struct clock_time end) {
    const struct instance_state *state = &instance->state;
    const double difference = clock_difference(end, state->cut_end);
    const double rounding = clock_rounding(instance_size_of_times(instance, end.s));
    return fabs(difference) <= rounding ? state->cut_end : end;
}

/* Begins a step at the time of the instance. Refuses times and parameters that do not fit. */
static enum status begin(struct instance *instance, double communication_point, double step_size,
                         const struct step_options *options, struct step *step) {
    static const struct step_options none = {0};
    const struct instance_state *state = &instance->state;
    const struct clock_time point = {.s = communication_point};
    const double mismatch = clock_difference(point, state->time);
    enum status status = refuse_times(instance, communication_point, step_size, mismatch);
    if (status == STATUS_OK) {
        status = instance_check_parameters(instance);
    }
    if (status != STATUS_OK) {
        return status;
    }
    *step = (struct step){
        .instance = instance,
        .options = options != NULL ? options : &none,
        .communication_point = communication_point,
        .begin = state->time,
        .end = clock_add(point, step_size),
        .drift = state->drift +
                 clock_step_drift(instance_size_of_times(instance, communication_point), mismatch),
        .answer = STATUS_OK,
        .steps_before = state->statistics.steps,
    };
    if (state->event_point != NO_EVENT) {
        step->end = resumed_end(instance, step->end);
    }
    instance->step_met_event = false;
    return instance_has_ended(instance) ? STATUS_ENDED : STATUS_OK;
}

/* Chooses how the integrator continues. Returns false if there is nothing to integrate, or an
 * internal step has passed the end of the step already: then the instance has the states there. */
static bool begin_motion(struct step *step, enum continuation *continuation) {
    struct instance *instance = step->instance;
    const struct model *model = instance->model;
    set_part(step);
    if (model->states.size == 0) {
        instance_move_anchors(instance);
        *continuation = CONTINUE_AFTER_CHANGE;
        return model->events != NULL;
    }
    const double target = clock_difference(step->end, instance->state.restart_time);
    *continuation = instance_continuation(instance, target);
    if (*continuation != CONTINUE_NOW || step->meets_time_event ||
        !integrator_interpolate(instance->integrator, target,
                                doubles_of(instance->memory.values, model->states))) {
        return true;
    }
    instance->state.latest_time = target;
    return false;
}

static void keep(struct step *step) {
    if (step->options->undo != NULL && !step->is_kept) {
        instance_keep(step->instance, step->options->undo);
        step->is_kept = true;
    }
}

/* Ends a step that has failed: sends the message about it, unless it has been sent, and undoes the
 * step. Returns the status. */
static enum status fail(const struct step *step, enum status status) {
    struct instance *instance = step->instance;
    struct explanation why = {.length = 0};
    if (!step->has_message && step->is_stuck && instance->sink.write != NULL) {
        instance_explain_step(instance, status, &why);
    }
    if (!step->has_message) {
        message_write(&instance->sink, status,
                      "the step from t = %.17g to t = %.17g ended at %.17g: %s",
                      step->communication_point, step->end.s, instance->state.time.s,
                      why.length > 0 ? why.text : status_text(status));
    }
    if (step->is_kept && status_severity(status) == SEVERITY_DISCARD) {
        const enum status restored = instance_undo(instance, step->options->undo);
        return restored == STATUS_OK ? status : restored;
    }
    instance->state.drift = step->drift;
    return status;
}

/* ---- The step ------------------------------------------------------------------------------- */

enum status instance_do_step(struct instance *instance, double communication_point,
                             double step_size, const struct step_options *options) {
    struct instance_state *state = &instance->state;
    struct step step;
    enum status status = begin(instance, communication_point, step_size, options, &step);
    if (status != STATUS_OK) {
        return status;
    }

    // the inputs over the step are polynomials, as set before or as the importer answers now
    if (step.options->ask_inputs != NULL) {
        instance->inputs_are_held = false;
        keep(&step);
        status = ask_inputs(&step, step_size);
        step.has_message = status != STATUS_OK;
    }
    if (status == STATUS_OK) {
        status = check_inputs(&step);
    }
    if (status != STATUS_OK) {
        return fail(&step, status);
    }

    // integrate to the end, or to one event after the other on the way
    enum continuation continuation;
    bool goes_on = begin_motion(&step, &continuation);
    if (goes_on) {
        keep(&step);
        status = begin_modes(&step, &continuation);
        goes_on = !step.has_ended;
    }
    while (goes_on && status == STATUS_OK) {
        status = integrate(&step, continuation);
        goes_on = status == STATUS_OK && (step.triggered != NULL || step.meets_time_event);
        if (goes_on) {
            move_to_event(&step);
            status = handle_event(&step);
            set_part(&step);
            goes_on = !is_done(&step);
            continuation = CONTINUE_AFTER_EVENT;
        }
    }

    // time and inputs at the end
    instance_set_clock(instance, status == STATUS_OK ? step.end : state->time);
    if (!instance->inputs_are_held) {
        end_inputs(&step);
    }
    if (status == STATUS_OK && state->event_point != EVENT_UNHANDLED) {
        status = instance_check_conditions(instance);
        step.has_message = status != STATUS_OK;
    }
    if (status != STATUS_OK) {
        return fail(&step, status);
    }
    if (step.options->ask_inputs != NULL) {
        keep_last_nodes(&step);
    }

    // report the end, unless the importer has chosen it
    const bool is_chosen = step.is_early && state->event_point == NO_EVENT;
    if (step.options->accept != NULL && !is_chosen) {
        (void)report(&step);
    }
    if (step.answer != STATUS_OK) {
        step.has_message = true;
        return fail(&step, step.answer);
    }
    state->drift = step.drift;
    return step.has_ended ? STATUS_ENDED : STATUS_OK;
}

bool instance_met_event(const struct instance *instance) {
    return instance->step_met_event;
}

bool instance_has_ended(const struct instance *instance) {
    return instance_explain_end(instance, NULL, 0);
}
