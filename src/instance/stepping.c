#include "stepping.h"

#include "fields.h"
#include "history.h"
#include "right_hand_side.h"
#include "settings.h"

#include <limits.h>
#include <math.h>

static enum status refuse_times(const struct instance *instance, double t, double h) {
    const struct instance_experiment *experiment = &instance->state.experiment;
    const struct clock_time now = instance->state.time;
    if (!isfinite(t) || !isfinite(h) || !(h > 0.0) || !isfinite(t + h)) {
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
    if (!(fabs(mismatch) <= clock_slack(t, h)) || !(mismatch + h > 0.0)) {
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

/* Inputs at the end of a step of the length elapsed (s). Their derivatives applied to it only. */
static void end_inputs(struct instance *instance, double elapsed) {
    struct instance_memory *memory = &instance->memory;
    const size_t input_count = count_of(instance->model->inputs);
    double *u = doubles_of(memory->values, instance->model->inputs);
    if (!instance_inputs_move(memory->pending, input_count)) {
        for (size_t i = 0; i < input_count; i++) {
            memory->current[i] = memory->pending[i];
            u[i] = memory->pending[i].d[0];
        }
        return;
    }
    for (size_t i = 0; i < input_count; i++) {
        memory->current[i] = polynomial_shifted(&memory->pending[i], elapsed);
        memory->pending[i] = (struct polynomial){{memory->pending[i].d[0]}};
        u[i] = memory->current[i].d[0];
    }
}

static enum status integrate_to(struct instance *instance, struct clock_time end) {
    struct instance_state *state = &instance->state;
    const struct clock_time begin = state->time;
    enum status status = instance_prepare_history(instance, end);
    if (status != STATUS_OK) {
        return status;
    }

    const double target = clock_difference(end, state->restart_time);
    status = integrator_advance(instance->integrator, target, state->own.max_internal_steps,
                                &state->latest_time,
                                doubles_of(instance->memory.values, instance->model->states));
    state->has_history = status == STATUS_OK && integrator_has_history(instance->integrator);
    if (!state->has_history) {
        state->next_step = status == STATUS_OK ? integrator_next_step(instance->integrator) : 0.0;
    }
    instance_set_clock(
        instance, status == STATUS_OK ? end : clock_add(state->restart_time, state->latest_time));
    end_inputs(instance, clock_difference(state->time, begin));
    update_statistics(instance);
    return status;
}

enum status instance_do_step(struct instance *instance, double communication_point, double step) {
    enum status status = refuse_times(instance, communication_point, step);
    if (status == STATUS_OK) {
        status = instance_check_parameters(instance);
    }
    if (status != STATUS_OK) {
        return status;
    }

    const struct clock_time end = clock_add((struct clock_time){.s = communication_point}, step);
    if (instance->integrator == NULL) {
        const double elapsed = clock_difference(end, instance->state.time);
        instance_set_clock(instance, end);
        end_inputs(instance, elapsed);
        return STATUS_OK;
    }
    status = integrate_to(instance, end);
    if (status != STATUS_OK) {
        message_write(&instance->sink, status,
                      "the step from t = %.17g to t = %.17g ended at %.17g: %s",
                      communication_point, end.s, instance->state.time.s, status_text(status));
    }
    return status;
}
