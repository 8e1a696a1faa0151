/* From one communication point to the next. */
#include "internals.h"

#include <limits.h>
#include <math.h>
#include <string.h>

static bool is_moving(const struct polynomial inputs[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        for (int k = 1; k <= POLYNOMIAL_DEGREE; k++) {
            if (inputs[i].d[k] != 0.0) {
                return true;
            }
        }
    }
    return false;
}

/* ---- What the integrator calls -------------------------------------------------------------- */

static void evaluate_inputs(const struct instance *instance, double t) {
    const size_t input_count = count_of(instance->model->inputs);
    for (size_t i = 0; i < input_count; i++) {
        instance->work[i] = polynomial_value(&instance->memory.running[i], t);
    }
}

enum status instance_rhs(double t, const double x[], double dx[], void *instance_pointer) {
    const struct instance *instance = instance_pointer;
    if (instance->inputs_move) {
        evaluate_inputs(instance, t);
    }
    return instance->model->right_hand_side(
        instance->memory.held, instance->state.restart_time.s + t, x, instance->work, dx);
}

enum status instance_jacobian(double t, const double x[], double J[], void *instance_pointer) {
    const struct instance *instance = instance_pointer;
    if (instance->inputs_move) {
        evaluate_inputs(instance, t);
    }
    return instance->model->jacobian(instance->memory.held, instance->state.restart_time.s + t, x,
                                     instance->work, J);
}

/* ---- Steps ---------------------------------------------------------------------------------- */

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

/* The next step's inputs are held at the values that the integrator runs with. Polynomials need no
 * comparison: the span of the integrator ends with the step that they are for. */
static bool inputs_are_held(const struct instance_memory *memory, size_t count) {
    for (size_t i = 0; i < count; i++) {
        const double *next = memory->pending[i].d;
        if (next[0] != memory->running[i].d[0]) {
            return false;
        }
        for (int k = 1; k <= POLYNOMIAL_DEGREE; k++) {
            if (next[k] != 0.0) {
                return false;
            }
        }
    }
    return true;
}

/* The parameters are those that the integrator runs with. */
static bool parameters_are_held(const struct instance *instance) {
    const struct instance_memory *memory = &instance->memory;
    const struct span parameters = instance->model->parameters;
    return memcmp(memory->held + parameters.offset, memory->values + parameters.offset,
                  parameters.size) == 0;
}

/* The integrator may go on from where it is to target. A pure function of what is set now and what
 * the integrator runs with: how often and in what order values were set does not matter.
 *
 * Any change of an input restarts it. Measured with inputs sampled from sines every 1 ms, going on
 * with CVODE's history over a jump has 450 times the error of a restart and is slower where jumps
 * are 4e-4 of the input, has 40 times the error at 4e-6 and 4 times at 4e-8. It gains only below
 * 1e-9, and rollback would have to replay every jump. */
static bool can_go_on(const struct instance *instance, double target) {
    const struct instance_memory *memory = &instance->memory;
    const struct instance_state *state = &instance->state;
    const size_t input_count = count_of(instance->model->inputs);
    return state->has_history && target <= state->span &&
           state->statistics.steps - state->steps_before_restart < INSTANCE_LONGEST_HISTORY &&
           parameters_are_held(instance) && inputs_are_held(memory, input_count);
}

/* For inputs that are held, once instead of at every evaluation. */
static void prepare_inputs(struct instance *instance) {
    instance->inputs_move = is_moving(instance->memory.running, count_of(instance->model->inputs));
    evaluate_inputs(instance, 0.0);
}

void instance_update_next_step(struct instance *instance) {
    if (instance->state.has_history && !instance->history_is_lost) {
        instance->state.next_step = integrator_next_step(instance->integrator);
    }
}

static enum status restart(struct instance *instance, struct clock_time end) {
    struct instance_memory *memory = &instance->memory;
    struct instance_state *state = &instance->state;
    const size_t input_count = count_of(instance->model->inputs);
    if (parameters_are_held(instance)) {
        instance_update_next_step(instance);
    } else {
        state->next_step = 0.0; // with others the instance is as good as new
    }
    state->has_history = false; // until the first advance has succeeded
    memcpy(memory->held, memory->values, instance->model->values_size);
    memcpy(memory->running, memory->pending, input_count * sizeof *memory->pending);
    prepare_inputs(instance);

    const double target = clock_difference(end, state->time);
    state->span = INFINITY;
    if (instance->inputs_move) {
        state->span = target;
    } else if (state->experiment.stop_time_defined) {
        const struct clock_time stop = {.s = state->experiment.stop_time};
        state->span = fmax(clock_difference(stop, state->time), target);
    }
    state->restart_time = state->time;
    state->first_time = target;
    state->steps_before_restart = state->statistics.steps;
    state->restart_step = state->next_step;
    instance->history_is_lost = false;
    return integrator_restart(instance->integrator,
                              doubles_of(memory->held, instance->model->states), state->span,
                              state->restart_step);
}

/* Brings the integrator to where the restored state says it is, in the internal steps that it says
 * this took: a state whose bytes were forged ends here. */
static enum status replay(struct instance *instance) {
    const struct instance_state *state = &instance->state;
    const struct span states = instance->model->states;
    const long steps = state->statistics.steps - state->steps_before_restart;
    double *x = doubles_of(instance->first, states);
    double reached;
    prepare_inputs(instance);
    enum status status =
        integrator_restart(instance->integrator, doubles_of(instance->memory.held, states),
                           state->span, state->restart_step);
    if (status == STATUS_OK) {
        status = integrator_advance(instance->integrator, state->first_time, steps, &reached, x);
    }
    if (status == STATUS_OK && state->latest_time > state->first_time) {
        status = integrator_advance(instance->integrator, state->latest_time, steps, &reached, x);
    }
    integrator_set_statistics(instance->integrator, &state->statistics);
    instance->history_is_lost = false;
    if (status != STATUS_OK) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "the restored state cannot be continued: it contradicts itself");
        return STATUS_INVALID_ARGUMENT;
    }
    return STATUS_OK;
}

static int saturated(long count) {
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

/* Inputs at the end of a step of the length elapsed (s); their derivatives applied to it alone. */
static void end_inputs(struct instance *instance, double elapsed) {
    struct instance_memory *memory = &instance->memory;
    const size_t input_count = count_of(instance->model->inputs);
    double *u = doubles_of(memory->values, instance->model->inputs);
    if (!is_moving(memory->pending, input_count)) {
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
    enum status status = STATUS_OK;
    if (!can_go_on(instance, clock_difference(end, state->restart_time))) {
        status = restart(instance, end);
    } else if (instance->history_is_lost) {
        status = replay(instance);
    }
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
