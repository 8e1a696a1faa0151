#include "step.h"

#include "fields.h"

#include <math.h>

void instance_begin_inputs(struct instance *instance) {
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

void instance_evaluate_inputs(struct instance *instance, double elapsed) {
    struct instance_memory *memory = &instance->memory;
    instance->inputs_are_held = false;
    double *u = doubles_of(memory->values, instance->model->inputs);
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        memory->current_inputs[i] = polynomial_shifted(&memory->next_inputs[i], elapsed);
        u[i] = memory->current_inputs[i].d[0];
    }
}

void instance_keep_last_nodes(const struct step *step) {
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

enum status instance_check_inputs(const struct step *step) {
    const struct instance *instance = step->instance;
    const double h = clock_difference(step->end, step->begin);
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        const struct polynomial *input = &instance->memory.next_inputs[i];
        if (polynomial_moves(input)) {
            const struct polynomial at_end = polynomial_shifted(input, h);
            if (!is_finite(&at_end)) {
                return instance_not_finite(instance, "an input at the end of the step");
            }
        }
    }
    return STATUS_OK;
}

static enum status set_polynomials(struct instance *instance, double h) {
    struct instance_memory *memory = &instance->memory;
    double *u = doubles_of(memory->values, instance->model->inputs);
    for (size_t i = 0; i < count_of(instance->model->inputs); i++) {
        const struct polynomial input =
            polynomial_through(instance->nodes + i * POLYNOMIAL_NODES, h);
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

enum status instance_ask_inputs(const struct step *step, double t, double h) {
    struct instance *instance = step->instance;
    for (int k = 0; k < POLYNOMIAL_NODES; k++) {
        const double time =
            k == POLYNOMIAL_NODES - 1 ? step->end.s : t + k * (h / (POLYNOMIAL_NODES - 1));
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
