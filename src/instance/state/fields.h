/* Where the values of an instance lie. */
#ifndef INSTANCE_FIELDS_H
#define INSTANCE_FIELDS_H

#include "internals.h"

/* Says in a message why there is no variable with this reference and type; NULL. */
NONNULL const struct variable *instance_refuse_reference(const struct instance *instance,
                                                         unsigned reference,
                                                         enum variable_type type);

/* The variable with this reference and type; NULL, with a message, if there is none. These and
 * instance_write_field are inline: they run once or more for each value that is set or read. */
static inline const struct variable *instance_find(const struct instance *instance,
                                                   unsigned reference, enum variable_type type) {
    const struct variable *variable = variable_find(instance->description, reference);
    return variable != NULL && variable->type == type
               ? variable
               : instance_refuse_reference(instance, reference, type);
}

/* Location of a variable's value. */
static inline void *instance_field(struct instance *instance, const struct variable *variable) {
    char *structure = variable->owner == VARIABLE_OF_MODEL ? instance->memory.values
                                                           : (char *)(void *)&instance->state.own;
    return structure + variable->offset;
}

static inline bool instance_is_state(const struct instance *instance,
                                     const struct variable *variable) {
    return variable->owner == VARIABLE_OF_MODEL &&
           variable->offset - instance->model->states.offset < instance->model->states.size;
}

/* Index of an input of type float64 among the inputs. */
static inline size_t instance_input_index(const struct instance *instance,
                                          const struct variable *variable) {
    return (variable->offset - instance->model->inputs.offset) / sizeof(double);
}

/* Writes the value; that of an input of type float64 also into its polynomial of the next step. */
static inline void instance_write_field(struct instance *instance, const struct variable *variable,
                                        double value) {
    void *field = instance_field(instance, variable);
    if (variable->causality == CAUSALITY_INPUT && variable->type == VARIABLE_FLOAT64) {
        const size_t i = instance_input_index(instance, variable);
        instance->memory.next_inputs[i].d[0] = value;
        instance->memory.current_inputs[i] = instance->memory.next_inputs[i];
        *(double *)field = value;
        return;
    }
    instance->parameters_are_active = false;
    instance->parameters_are_valid &= variable->causality != CAUSALITY_PARAMETER;
    if (variable->type == VARIABLE_FLOAT64) {
        *(double *)field = value;
    } else {
        *(int *)field = (int)value;
    }
}

static inline void instance_set_clock(struct instance *instance, struct clock_time time) {
    instance->state.time = time;
    instance->state.own.time = time.s;
    instance->outputs_are_valid = false;
}

/* Writes the variables that show totals of the integrator. */
NONNULL void instance_write_statistics(const struct integrator_statistics *statistics,
                                       struct instance_values *own);

/* Returns STATUS_NOT_FINITE, with a message that `what` cannot be computed. */
NONNULL enum status instance_not_finite(const struct instance *instance, const char *what);

#endif
