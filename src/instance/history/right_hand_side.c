#include "right_hand_side.h"

#include <float.h>
#include <math.h>

_Static_assert((int)SERIES_INPUT_LENGTH == (int)POLYNOMIAL_DEGREE + 1,
               "the series of an input is its polynomial");

static void evaluate_inputs(const struct instance *instance, double t) {
    const size_t input_count = count_of(instance->model->inputs);
    for (size_t i = 0; i < input_count; i++) {
        instance->u[i] = polynomial_value(&instance->memory.active_inputs[i], t);
    }
}

void instance_prepare_inputs(struct instance *instance, bool moves) {
    const bool had_moved = instance->inputs_move;
    instance->inputs_move = moves;
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        const struct polynomial *input = &instance->memory.active_inputs[i];
        double *series = instance->input_series[i];
        instance->u[i] = input->d[0];
        series[0] = input->d[0]; // all there is, unless inputs move
        for (int k = 1; had_moved && k <= POLYNOMIAL_DEGREE; k++) {
            series[k] = 0.0;
        }
    }
}

enum status instance_rhs(double t, const double x[], double dx[], void *instance_pointer) {
    const struct instance *instance = instance_pointer;
    if (instance->inputs_move) {
        evaluate_inputs(instance, t);
    }
    return instance->model->right_hand_side(instance->memory.restart_values,
                                            instance->state.restart_time.s + t, x, instance->u, dx);
}

enum status instance_jacobian(double t, const double x[], double J[], void *instance_pointer) {
    const struct instance *instance = instance_pointer;
    if (instance->inputs_move) {
        evaluate_inputs(instance, t);
    }
    return instance->model->jacobian(instance->memory.restart_values,
                                     instance->state.restart_time.s + t, x, instance->u, J);
}

enum status instance_indicators(double t, const double x[], double z[], void *instance_pointer) {
    const struct instance *instance = instance_pointer;
    if (instance->inputs_move) {
        evaluate_inputs(instance, t);
    }
    return instance->model->events->indicators(
        instance->memory.restart_values, instance->state.restart_time.s + t, x, instance->u, z);
}

void instance_rounding(double rounding[], void *instance_pointer) {
    const struct instance *instance = instance_pointer;
    const struct range states = instance->model->states;
    const double *x = doubles_of(instance->memory.restart_values, states);
    double *errors = doubles_of(instance->second_derivatives, states);
    for (size_t i = 0; i < count_of(states); i++) {
        errors[i] = 2.0 * DBL_EPSILON * fabs(x[i]);
    }
    instance->model->events->errors(instance->memory.restart_values, instance->state.restart_time.s,
                                    errors, 2.0 * DBL_EPSILON, rounding);
}

void instance_reach(const double x[], double reach[], void *instance_pointer) {
    const struct instance *instance = instance_pointer;
    instance->model->events->reach(instance->memory.restart_values, x, reach);
}

/* Coefficients of the inputs at t, for the time scale time_scale. */
static void expand_inputs(const struct instance *instance, double t, double time_scale) {
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        double *coefficients = instance->input_series[i];
        const struct polynomial input = polynomial_shifted(&instance->memory.active_inputs[i], t);
        double power = 1.0; // time_scale^k / k!
        for (int k = 0; k <= POLYNOMIAL_DEGREE; k++) {
            coefficients[k] = input.d[k] * power;
            power *= time_scale / (k + 1);
        }
    }
}

enum status instance_series(double t, double time_scale, int first, int last,
                            double rows[][SERIES_LENGTH], void *instance_pointer) {
    const struct instance *instance = instance_pointer;
    if (first == 0 && instance->inputs_move) {
        expand_inputs(instance, t, time_scale);
    }
    const struct series_origin origin = {
        .values = instance->memory.restart_values,
        .t = instance->state.restart_time.s + t,
        .time_scale = time_scale,
        .inputs = (const double(*)[SERIES_INPUT_LENGTH])instance->input_series,
    };
    return instance->model->series->extend(&origin, first, last, rows);
}
