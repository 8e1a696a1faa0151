#include "right_hand_side.h"

#include <string.h>

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

/* Column by column: derivatives along each state. */
enum status instance_jacobian(double t, const double x[], double J[], void *instance_pointer) {
    struct instance *instance = instance_pointer;
    const struct model *model = instance->model;
    const double time = instance->state.restart_time.s + t;
    const size_t n = count_of(model->states);
    char *point = instance->second_derivatives;
    if (instance->inputs_move) {
        evaluate_inputs(instance, t);
    }
    memcpy(point, instance->memory.held, model->values_size);
    memcpy(doubles_of(point, model->states), x, model->states.size);
    if (model->inputs.size > 0) {
        memcpy(doubles_of(point, model->inputs), instance->u, model->inputs.size);
    }
    enum status status = model->outputs(point, time);
    for (size_t j = 0; j < n && status == STATUS_OK; j++) {
        memset(instance->first_derivatives, 0, model->values_size);
        doubles_of(instance->first_derivatives, model->states)[j] = 1.0;
        status = model->propagate(point, time, 0.0, instance->first_derivatives, NULL);
        memcpy(&J[n * j], doubles_of(instance->first_derivatives, model->derivatives),
               n * sizeof(double));
    }
    return status;
}
