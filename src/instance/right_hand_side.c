#include "right_hand_side.h"

bool instance_inputs_move(const struct polynomial inputs[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        for (int k = 1; k <= POLYNOMIAL_DEGREE; k++) {
            if (inputs[i].d[k] != 0.0) {
                return true;
            }
        }
    }
    return false;
}

static void evaluate_inputs(const struct instance *instance, double t) {
    const size_t input_count = count_of(instance->model->inputs);
    for (size_t i = 0; i < input_count; i++) {
        instance->u[i] = polynomial_value(&instance->memory.running[i], t);
    }
}

void instance_prepare_inputs(struct instance *instance) {
    instance->inputs_move =
        instance_inputs_move(instance->memory.running, count_of(instance->model->inputs));
    evaluate_inputs(instance, 0.0);
}

enum status instance_rhs(double t, const double x[], double dx[], void *instance_pointer) {
    const struct instance *instance = instance_pointer;
    if (instance->inputs_move) {
        evaluate_inputs(instance, t);
    }
    return instance->model->right_hand_side(instance->memory.held,
                                            instance->state.restart_time.s + t, x, instance->u, dx);
}

enum status instance_jacobian(double t, const double x[], double J[], void *instance_pointer) {
    const struct instance *instance = instance_pointer;
    if (instance->inputs_move) {
        evaluate_inputs(instance, t);
    }
    return instance->model->jacobian(instance->memory.held, instance->state.restart_time.s + t, x,
                                     instance->u, J);
}
