#include "stepping.h"

#include "event_point.h"
#include "fields.h"
#include "settings.h"
#include "snapshot_contents.h"
#include "step.h"

#include <math.h>
#include <string.h>

/* s: integrators go beyond the end of a step, by up to 1e4 times its length. With times that then
 * overflow cvode_bdf would try the same step without end. */
static const double latest_time = 1e300;

/* mismatch (s): of t from the time of the instance. */
static enum status refuse_times(const struct instance *instance, double t, double h,
                                double mismatch) {
    const struct instance_experiment *experiment = &instance->state.experiment;
    const double slack = clock_slack(instance_size_of_times(instance, t), h);
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
    if (!(fabs(mismatch) <= slack && mismatch + h > 0.0)) {
        message_write(&instance->sink, STATUS_INVALID_TIME,
                      "a step from t = %.17g is refused: the instance is at t = %.17g", t,
                      instance->state.time.s);
        return STATUS_INVALID_TIME;
    }
    if (experiment->stop_time_defined && t + h - experiment->stop_time > slack) {
        message_write(&instance->sink, STATUS_INVALID_TIME,
                      "a step from t = %.17g to t = %.17g is refused: the stop time is %.17g", t,
                      t + h, experiment->stop_time);
        return STATUS_INVALID_TIME;
    }
    return STATUS_OK;
}

/* ---- Inputs --------------------------------------------------------------------------------- */

/* Inputs at the end of a step. Their derivatives applied to it only. */
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

/* ---- Integration ---------------------------------------------------------------------------- */

static void keep(struct step *step) {
    if (step->options->undo != NULL && step->kept == NULL) {
        step->kept = step->options->undo;
        instance_keep(step->instance, step->kept);
    }
}

/* The instance is at the time where the step has ended. */
static void arrive(const struct step *step, struct clock_time time) {
    instance_set_clock(step->instance, time);
    if (!step->instance->inputs_are_held) {
        end_inputs(step);
    }
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
                                   ? instance_move(step, continuation)
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
        instance->inputs_are_held = false;
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
        instance_keep_last_nodes(step);
    }
    const bool ends_at_event = instance->state.event_point != NO_EVENT;
    if (step->options->accept != NULL && (!step->is_early || ends_at_event)) {
        (void)instance_report(step);
    }
    return step->answer;
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
        step.end = instance_resumed_end(instance, step.end);
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

enum status instance_do_step(struct instance *instance, double communication_point, double step) {
    static const struct step_options none = {0};
    return instance_do_step_with(instance, communication_point, step, &none);
}

bool instance_met_event(const struct instance *instance) {
    return instance->step_met_event;
}
