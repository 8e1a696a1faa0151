#include "instance.h"

#include "history.h"
#include "modes.h"
#include "snapshot.h"
#include "state.h"

#include <stdlib.h>
#include <string.h>

/* ---- Life ----------------------------------------------------------------------------------- */

/* Rounds the size up, so that data behind a value structure is aligned for any type. */
static size_t aligned(size_t size) {
    const size_t alignment = _Alignof(max_align_t);
    return (size + alignment - 1) / alignment * alignment;
}

/* Locates the parts that a step writes: no parameters, except the restart's. */
static void locate_written(const struct model *model, struct instance_memory *memory) {
    const struct model_events events = events_of(model);
    const struct range ranges[] = {model->inputs,          model->states,          events.modes,
                                   events.discrete_states, events.discrete_inputs, model->anchors};
    size_t begin = model->values_size;
    size_t end = 0;
    for (size_t i = 0; i < sizeof ranges / sizeof ranges[0]; i++) {
        const size_t own_end = ranges[i].offset + ranges[i].size;
        begin = ranges[i].size > 0 && ranges[i].offset < begin ? ranges[i].offset : begin;
        end = ranges[i].size > 0 && own_end > end ? own_end : end;
    }
    const size_t first = (size_t)((char *)memory->active_inputs - memory->block);
    const size_t restart = (size_t)(memory->restart_values - memory->block);
    memory->written_at_restart = (struct range){first, restart + end - first};
    memory->written = (struct range){begin, end > begin ? end - begin : 0};
}

static bool lies_in(struct range range, const struct variable *variable) {
    return variable->offset >= range.offset && variable->offset - range.offset < range.size;
}

/* True if, by initialization, only events write the value: a mode, a discrete state or a state
 * whose start value is calculated. */
static bool is_kept_by_events(const struct model *model, const struct variable *variable) {
    const struct model_events events = events_of(model);
    return variable->owner == VARIABLE_OF_MODEL &&
           (lies_in(events.modes, variable) || lies_in(events.discrete_states, variable) ||
            (events.starts_follow && lies_in(model->states, variable)));
}

/* True if the variable is bound to a field of its own kind. Modes (ints) are calculated and
 * discrete; discrete states (doubles) are discrete, and may have a start value. */
static bool is_bound_well(const struct model *model, const struct variable *variable) {
    const struct model_events events = events_of(model);
    const bool is_real = variable->type == VARIABLE_FLOAT64;
    const bool is_parameter = variable->causality == CAUSALITY_PARAMETER;
    const bool is_input = variable->causality == CAUSALITY_INPUT;
    const bool is_exact = !is_parameter && variable->initial == INITIAL_EXACT;
    const bool is_discrete = variable->variability == VARIABILITY_DISCRETE;
    const bool is_started = events.starts_follow && variable->initial == INITIAL_CALCULATED;
    return is_parameter == lies_in(model->parameters, variable) &&
           (is_input && is_real) == lies_in(model->inputs, variable) &&
           (is_input && !is_real) == lies_in(events.discrete_inputs, variable) &&
           (is_exact && !is_discrete) == (lies_in(model->states, variable) && !is_started) &&
           (!lies_in(events.modes, variable) || (is_discrete && !is_exact && !is_real)) &&
           (!lies_in(events.discrete_states, variable) || (is_discrete && is_real)) &&
           (!(is_exact && is_discrete) || lies_in(events.discrete_states, variable));
}

/* Checks that each variable is bound to a field of its own kind: a wrong binding compiles, but the
 * value would have no effect. */
static enum status check_bindings(const struct model_description *description,
                                  const struct message_sink *sink) {
    const size_t indicator_count = events_of(description->model).indicator_count;
    if (description->indicator_count != indicator_count) {
        message_write(sink, STATUS_INTERNAL,
                      "%zu event indicators of %s are declared: its model has %zu",
                      description->indicator_count, description->name, indicator_count);
        return STATUS_INTERNAL;
    }
    if (description->has_time_events != (events_of(description->model).next_time != NULL)) {
        message_write(sink, STATUS_INTERNAL, "time events of %s are %sdeclared: its model has %s",
                      description->name, description->has_time_events ? "" : "not ",
                      description->has_time_events ? "none" : "some");
        return STATUS_INTERNAL;
    }
    for (size_t i = 0; i < description->variable_count; i++) {
        const struct variable *variable = &description->variables[i];
        if (variable->owner == VARIABLE_OF_MODEL && !is_bound_well(description->model, variable)) {
            message_write(sink, STATUS_INTERNAL,
                          "%s is bound to a field that is not of its kind among the values of %s",
                          variable->name, description->name);
            return STATUS_INTERNAL;
        }
    }
    return STATUS_OK;
}

/* Locates the values of all references. An input reads as the value set last, also after a step
 * over which it moved. */
static void locate_reals(struct instance *instance) {
    for (size_t i = 0; i < instance->description->variable_count; i++) {
        const struct variable *variable = &instance->description->variables[i];
        struct instance_real *real = &instance->reals[variable->reference];
        real->is_kept =
            variable->initial == INITIAL_CALCULATED && is_kept_by_events(instance->model, variable);
        real->is_calculated = variable->initial == INITIAL_CALCULATED &&
                              variable->owner == VARIABLE_OF_MODEL && !real->is_kept;
        if (variable->type != VARIABLE_FLOAT64) {
            continue;
        }
        real->value = instance_field(instance, variable);
        if (variable->causality == CAUSALITY_INPUT) {
            real->value = instance->memory.next_inputs[instance_input_index(instance, variable)].d;
        }
    }
}

static bool setup_events(struct instance *instance) {
    const struct model *model = instance->model;
    const size_t state_count = count_of(model->states);
    const size_t count = model->events->indicator_count;
    instance->absolute_tolerances =
        calloc(2 * state_count + count_of(model->inputs) + 3 * count + 1, sizeof(double));
    instance->indicators = calloc(count + 1, sizeof *instance->indicators);
    instance->triggered = calloc(count + 1, sizeof *instance->triggered);
    if (instance->absolute_tolerances == NULL || instance->indicators == NULL ||
        instance->triggered == NULL) {
        return false;
    }
    instance->event_tolerances = instance->absolute_tolerances + state_count;
    instance->du = instance->event_tolerances + state_count;
    instance->z = instance->du + count_of(model->inputs);
    instance->ode.indicator_count = model->events->indicator_count;
    instance->ode.indicators = instance_indicators;
    instance->ode.rounding = model->events->errors != NULL ? instance_rounding : NULL;
    instance->ode.reach = model->events->reach != NULL ? instance_reach : NULL;
    return true;
}

static enum status setup(struct instance *instance) {
    const struct model *model = instance->model;
    const size_t values_size = aligned(model->values_size);
    const size_t input_count = count_of(model->inputs);
    const size_t inputs_size =
        3 * input_count * sizeof(struct polynomial) + instance_noted_inputs(model) * sizeof(double);
    const size_t before_values = aligned(inputs_size + instance_event_size(model));
    struct instance_memory *memory = &instance->memory;

    memory->size = before_values + 2 * values_size;
    /* the inputs in front of the block: a step reads both */
    const size_t before_block = aligned((1 + SERIES_INPUT_LENGTH) * input_count * sizeof(double));
    const size_t nodes_size = POLYNOMIAL_NODES * input_count * sizeof(double);
    instance->u = calloc(1, before_block + memory->size);
    instance->first_derivatives = calloc(1, 2 * values_size + nodes_size);
    instance->reals = calloc(instance->description->reference_count, sizeof *instance->reals);
    if (instance->u == NULL || instance->first_derivatives == NULL || instance->reals == NULL) {
        return STATUS_OUT_OF_MEMORY;
    }
    instance->second_derivatives = instance->first_derivatives + values_size;
    instance->nodes = (double *)(void *)(instance->second_derivatives + values_size);
    instance->input_series = (double(*)[SERIES_INPUT_LENGTH])(instance->u + input_count);
    instance->has_avx2 =
        model->series != NULL && model->series->asks_for_avx2 && processor_has_avx2();
    memory->block = (char *)instance->u + before_block;
    memory->next_inputs = (struct polynomial *)(void *)memory->block;
    memory->current_inputs = memory->next_inputs + input_count;
    memory->active_inputs = memory->current_inputs + input_count;
    memory->largest_inputs = (double *)(void *)(memory->active_inputs + input_count);
    memory->unhandled = (bool *)(void *)(memory->largest_inputs + instance_noted_inputs(model));
    memory->restart_values = memory->block + before_values;
    memory->values = memory->restart_values + values_size;
    locate_written(model, memory);
    locate_reals(instance);
    if (model->events != NULL && !setup_events(instance)) {
        return STATUS_OUT_OF_MEMORY;
    }
    if (model->events != NULL || model->anchor != NULL) {
        instance->initial_values = calloc(1, values_size);
        if (instance->initial_values == NULL) {
            return STATUS_OUT_OF_MEMORY;
        }
    }

    if (model->states.size == 0 && instance->ode.indicator_count == 0) {
        return STATUS_OK;
    }
    instance->ode.state_count = count_of(model->states);
    instance->ode.gradient_count = (unsigned)model->gradient_count;
    instance->ode.rhs = instance_rhs;
    instance->ode.jacobian = instance_jacobian;
    instance->ode.band = model->band;
    instance->ode.may_end = model->explain != NULL;
    instance->ode.settle = model->anchor != NULL ? instance_settle : NULL;
    instance->ode.context = instance;
    if (model->series != NULL) {
        instance->ode.series = instance_series;
        instance->ode.series_row_count = model->series->row_count;
        instance->ode.rows = model->series;
    }
    return integrator_create(&instance->ode, &instance->sink, &instance->integrator);
}

enum status instance_create(const struct model_description *description,
                            const struct message_sink *sink, struct instance **instance) {
    *instance = NULL;
    struct instance *created = calloc(1, sizeof *created);
    enum status status = created != NULL ? check_bindings(description, sink) : STATUS_OUT_OF_MEMORY;
    if (status == STATUS_OK) {
        created->description = description;
        created->model = description->model;
        created->sink = *sink;
        status = setup(created);
    }
    if (status != STATUS_OK) {
        message_write(sink, status, "no instance of %s: %s", description->name,
                      status_text(status));
        instance_destroy(created);
        return status;
    }
    instance_reset(created);
    *instance = created;
    return STATUS_OK;
}

void instance_destroy(struct instance *instance) {
    if (instance == NULL) {
        return;
    }
    while (instance->newest != NULL) {
        struct instance_snapshot *snapshot = instance->newest;
        instance_forget(instance, &snapshot);
    }
    integrator_destroy(instance->integrator);
    free(instance->initial_values);
    free(instance->triggered);
    free(instance->indicators);
    free(instance->absolute_tolerances);
    free(instance->reals);
    free(instance->u);
    free(instance->first_derivatives);
    free(instance);
}

void instance_reset(struct instance *instance) {
    memset(instance->memory.block, 0, instance->memory.size);
    instance->state = (struct instance_state){.phase = PHASE_INSTANTIATED};
    instance->inputs_are_held = false;
    instance->state.own.solver_method = INTEGRATOR_CVODE_ADAMS;
    instance->state.own.max_internal_steps = 100000;
    instance->state.own.max_events = 1000;
    for (size_t i = 0; i < instance->description->variable_count; i++) {
        instance_write_field(instance, &instance->description->variables[i],
                             instance->description->variables[i].start);
    }
    instance_set_clock(instance, (struct clock_time){0});
    instance_update_tolerance(instance);
}

enum status instance_setup_experiment(struct instance *instance,
                                      const struct instance_experiment *experiment) {
    const enum status status = instance_check_experiment(instance, experiment);
    if (status == STATUS_OK) {
        instance->state.experiment = *experiment;
        instance->state.experiment_defined = true;
        instance_set_clock(instance, (struct clock_time){.s = experiment->start_time});
        instance_update_tolerance(instance);
    }
    return status;
}

/* ---- Initialization ------------------------------------------------------------------------- */

enum status instance_enter_initialization(struct instance *instance) {
    if (!instance->state.experiment_defined) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "initialization is refused: the experiment must be set up first");
        return STATUS_INVALID_ARGUMENT;
    }
    instance->state.phase = PHASE_INITIALIZATION;
    instance->state.own.last_event_time = instance->state.time.s;
    instance->outputs_are_valid = false;
    return STATUS_OK;
}

/* Returns STATUS_OK if the chosen method can integrate the model; otherwise a message names methods
 * that can. */
static enum status check_method(const struct instance *instance) {
    const enum integrator_method method = (enum integrator_method)instance->state.own.solver_method;
    if (integrator_is_possible(method, &instance->ode)) {
        return STATUS_OK;
    }
    message_write(
        &instance->sink, STATUS_INVALID_PARAMETERS,
        "solver_method = %d (%s) is refused: %s has no Taylor series. %d (%s) is for any model, "
        "%d (%s) for a stiff one, %d (%s) for inputs that change in each step",
        (int)method, integrator_method_name(method), instance->description->name,
        INTEGRATOR_CVODE_ADAMS, integrator_method_name(INTEGRATOR_CVODE_ADAMS),
        INTEGRATOR_CVODE_BDF, integrator_method_name(INTEGRATOR_CVODE_BDF), INTEGRATOR_ERK,
        integrator_method_name(INTEGRATOR_ERK));
    return STATUS_INVALID_PARAMETERS;
}

/* Sends a message if the experiment's tolerance is too coarse to be used. */
static void report_tolerance(const struct instance *instance) {
    const struct instance_state *state = &instance->state;
    if (state->own.relative_tolerance == 0.0 && state->experiment.tolerance_defined &&
        state->experiment.tolerance > INSTANCE_COARSEST_EXPERIMENT_TOLERANCE) {
        message_write(&instance->sink, STATUS_COARSE_TOLERANCE,
                      "the tolerance %g of the experiment is too coarse: %g is used instead. Set "
                      "relative_tolerance for a coarser one",
                      state->experiment.tolerance, INSTANCE_COARSEST_EXPERIMENT_TOLERANCE);
    }
}

static enum status setup_integrator(struct instance *instance) {
    enum status status = check_method(instance);
    if (status != STATUS_OK) {
        return status;
    }
    report_tolerance(instance);
    status = instance_configure_integrator(instance);
    if (status != STATUS_OK) {
        message_write(&instance->sink, status, "initialization failed: %s", status_text(status));
    }
    return status;
}

enum status instance_exit_initialization(struct instance *instance) {
    enum status status = instance_check_parameters(instance);
    if (status == STATUS_OK && instance_has_integrator(instance)) {
        status = setup_integrator(instance);
    }
    if (status == STATUS_OK) {
        status = instance_update_modes(instance, NULL);
    }
    if (status == STATUS_OK) {
        instance_move_anchors(instance);
        instance->state.phase = PHASE_STEPPING;
    }
    return status;
}

void instance_integrate_outside(struct instance *instance) {
    instance->is_integrated_outside = true;
}

void instance_allow_setting_states(struct instance *instance) {
    instance->states_are_settable = true;
}

double instance_time(const struct instance *instance) {
    return instance->state.time.s;
}
