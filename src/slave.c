#include "slave_state.h"
#include "snapshot.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The integrator runs at this fraction of the tolerance asked for.
 * CVODE: each restart, one per change of an input, adds an error of the order of the local
 * tolerance, and thousands of them add up. Larger: faster and less accurate.
 * erk: the largest power of ten at which its error, measured with steps of 1 ms to 2 s, is that of
 * CVODE or less (at one of 31 points a fifth more); with shorter steps it is that of rounding. */
static const double tolerance_fractions[INTEGRATOR_METHODS] = {
    [INTEGRATOR_CVODE_ADAMS] = 2e-3,
    [INTEGRATOR_CVODE_BDF] = 2e-3,
    [INTEGRATOR_ERK] = 1e-2,
};

/* Absolute tolerance of a state, over relative tolerance times nominal value. */
static const double absolute_fraction = 1e-2;

/* ---- Life ----------------------------------------------------------------------------------- */

/* Blocks of the value structures stay aligned for any type. */
static size_t aligned(size_t size) {
    const size_t alignment = _Alignof(max_align_t);
    return (size + alignment - 1) / alignment * alignment;
}

static bool lies_in(struct span span, const struct variable *variable) {
    return variable->offset >= span.offset && variable->offset - span.offset < span.size;
}

/* The fields that variables.toml binds are where the model says that such values are: a wrong
 * binding compiles, but the value would have no effect. */
static enum status check_bindings(const struct unit *unit, const struct message_sink *sink) {
    for (size_t i = 0; i < unit->variable_count; i++) {
        const struct variable *variable = &unit->variables[i];
        const struct model *model = unit->model;
        const bool is_parameter = variable->causality == CAUSALITY_PARAMETER;
        const bool is_input = variable->causality == CAUSALITY_INPUT;
        const bool is_state = !is_parameter && variable->initial == INITIAL_EXACT;
        if (variable->owner == VARIABLE_OF_MODEL &&
            (is_parameter != lies_in(model->parameters, variable) ||
             is_input != lies_in(model->inputs, variable) ||
             is_state != lies_in(model->states, variable))) {
            message_write(sink, STATUS_INTERNAL,
                          "%s is bound to a field that is not of its kind among the values of %s",
                          variable->name, unit->name);
            return STATUS_INTERNAL;
        }
    }
    return STATUS_OK;
}

static enum status setup(struct slave *slave) {
    const struct model *model = slave->model;
    const size_t values_size = aligned(model->values_size);
    const size_t input_count = count_of(model->inputs);
    struct slave_memory *memory = &slave->memory;

    memory->size = 2 * values_size + 3 * input_count * sizeof(struct polynomial);
    memory->block = calloc(1, memory->size);
    slave->first = calloc(2, values_size);
    slave->work = calloc(input_count + 1, sizeof(double));
    if (memory->block == NULL || slave->first == NULL || slave->work == NULL) {
        return STATUS_OUT_OF_MEMORY;
    }
    slave->second = slave->first + values_size;
    memory->values = memory->block;
    memory->held = memory->values + values_size;
    memory->pending = (struct polynomial *)(void *)(memory->held + values_size);
    memory->current = memory->pending + input_count;
    memory->running = memory->current + input_count;

    if (model->states.size == 0) {
        return STATUS_OK;
    }
    const struct ode ode = {.state_count = count_of(model->states),
                            .rhs = slave_rhs,
                            .jacobian = slave_jacobian,
                            .context = slave};
    return integrator_create(&ode, &slave->sink, &slave->integrator);
}

enum status slave_create(const struct unit *unit, const struct message_sink *sink,
                         struct slave **slave) {
    *slave = NULL;
    struct slave *created = calloc(1, sizeof *created);
    enum status status = created != NULL ? check_bindings(unit, sink) : STATUS_OUT_OF_MEMORY;
    if (status == STATUS_OK) {
        created->unit = unit;
        created->model = unit->model;
        created->sink = *sink;
        status = setup(created);
    }
    if (status != STATUS_OK) {
        message_write(sink, status, "no instance of %s: %s", unit->name, status_text(status));
        slave_destroy(created);
        return status;
    }
    slave_reset(created);
    *slave = created;
    return STATUS_OK;
}

void slave_destroy(struct slave *slave) {
    if (slave == NULL) {
        return;
    }
    while (slave->newest != NULL) {
        struct slave_snapshot *snapshot = slave->newest;
        slave_forget(slave, &snapshot);
    }
    integrator_destroy(slave->integrator);
    free(slave->work);
    free(slave->first);
    free(slave->memory.block);
    free(slave);
}

/* The parameter wins over the experiment, which wins over the unit's default. */
void slave_update_tolerance(struct slave *slave) {
    struct slave_state *state = &slave->state;
    double tolerance = slave->unit->default_tolerance;
    if (state->own.relative_tolerance > 0.0) {
        tolerance = state->own.relative_tolerance;
    } else if (state->experiment.tolerance_defined) {
        tolerance = state->experiment.tolerance;
    }
    state->own.effective_relative_tolerance = fmin(
        fmax(tolerance_fractions[state->own.solver_method] * tolerance, SLAVE_FINEST_TOLERANCE),
        SLAVE_COARSEST_TOLERANCE);
}

void slave_set_clock(struct slave *slave, struct clock_time time) {
    slave->state.time = time;
    slave->state.own.time = time.s;
    slave->outputs_are_valid = false;
}

void slave_reset(struct slave *slave) {
    memset(slave->memory.block, 0, slave->memory.size);
    slave->state = (struct slave_state){.phase = PHASE_INSTANTIATED};
    slave->state.own.solver_method = INTEGRATOR_CVODE_ADAMS;
    for (size_t i = 0; i < slave->unit->variable_count; i++) {
        slave_write_field(slave, &slave->unit->variables[i], slave->unit->variables[i].start);
    }
    slave_set_clock(slave, (struct clock_time){0});
    slave_update_tolerance(slave);
}

enum status slave_check_experiment(const struct slave *slave,
                                   const struct slave_experiment *experiment) {
    const double start = experiment->start_time;
    if (!isfinite(start)) {
        message_write(&slave->sink, STATUS_INVALID_ARGUMENT,
                      "start time %g is refused: a finite time is expected", start);
        return STATUS_INVALID_ARGUMENT;
    }
    if (experiment->stop_time_defined &&
        !(isfinite(experiment->stop_time) && experiment->stop_time >= start)) {
        message_write(&slave->sink, STATUS_INVALID_ARGUMENT,
                      "stop time %.17g is refused: a finite time, not before the start time %.17g, "
                      "is expected",
                      experiment->stop_time, start);
        return STATUS_INVALID_ARGUMENT;
    }
    if (experiment->tolerance_defined &&
        !(isfinite(experiment->tolerance) && experiment->tolerance > 0.0)) {
        message_write(&slave->sink, STATUS_INVALID_ARGUMENT,
                      "tolerance %g is refused: a finite value above 0 is expected",
                      experiment->tolerance);
        return STATUS_INVALID_ARGUMENT;
    }
    return STATUS_OK;
}

enum status slave_setup_experiment(struct slave *slave, const struct slave_experiment *experiment) {
    const enum status status = slave_check_experiment(slave, experiment);
    if (status == STATUS_OK) {
        slave->state.experiment = *experiment;
        slave->state.experiment_defined = true;
        slave_set_clock(slave, (struct clock_time){.s = experiment->start_time});
        slave_update_tolerance(slave);
    }
    return status;
}

/* ---- Initialization ------------------------------------------------------------------------- */

enum status slave_enter_initialization(struct slave *slave) {
    if (!slave->state.experiment_defined) {
        message_write(&slave->sink, STATUS_INVALID_ARGUMENT,
                      "initialization is refused: the experiment must be set up first");
        return STATUS_INVALID_ARGUMENT;
    }
    slave->state.phase = PHASE_INITIALIZATION;
    return STATUS_OK;
}

enum status slave_check_parameters(const struct slave *slave) {
    char text[256]; // written where the parameters are refused
    const enum status status =
        slave->model->check_parameters(slave->memory.values, text, sizeof text);
    if (status != STATUS_OK) {
        message_write(&slave->sink, status, "%s", text);
    }
    return status;
}

static struct integrator_settings settings_of(const struct slave *slave) {
    const struct slave_values *own = &slave->state.own;
    return (struct integrator_settings){
        .method = (enum integrator_method)own->solver_method,
        .relative_tolerance = own->effective_relative_tolerance,
        .max_step = own->max_step,
    };
}

bool slave_is_configured_otherwise(const struct slave *slave) {
    const struct integrator_settings wanted = settings_of(slave);
    return slave->configured.method != wanted.method ||
           slave->configured.relative_tolerance != wanted.relative_tolerance ||
           slave->configured.max_step != wanted.max_step;
}

enum status slave_configure_integrator(struct slave *slave) {
    const struct span states = slave->model->states;
    const double tolerance = slave->state.own.effective_relative_tolerance;
    double *absolute = doubles_of(slave->first, states);
    for (size_t i = 0; i < slave->unit->variable_count; i++) {
        const struct variable *variable = &slave->unit->variables[i];
        const size_t from_states = variable->offset - states.offset;
        if (variable->owner == VARIABLE_OF_MODEL && from_states < states.size) {
            absolute[from_states / sizeof(double)] =
                absolute_fraction * variable->nominal * tolerance;
        }
    }
    struct integrator_settings settings = settings_of(slave);
    settings.absolute_tolerances = absolute;
    const enum status status = integrator_configure(slave->integrator, &settings);
    slave->configured = status == STATUS_OK ? settings : (struct integrator_settings){0};
    slave->configured.absolute_tolerances = NULL;
    return status;
}

enum status slave_exit_initialization(struct slave *slave) {
    enum status status = slave_check_parameters(slave);
    if (status == STATUS_OK && slave->integrator != NULL) {
        status = slave_configure_integrator(slave);
        if (status != STATUS_OK) {
            message_write(&slave->sink, status, "initialization failed: %s", status_text(status));
        }
    }
    if (status == STATUS_OK) {
        slave->state.phase = PHASE_STEPPING;
    }
    return status;
}

double slave_time(const struct slave *slave) {
    return slave->state.time.s;
}

/* ---- Integration from outside --------------------------------------------------------------- */

enum status slave_enter_continuous_time(struct slave *slave) {
    const enum status status = slave_check_parameters(slave);
    if (status == STATUS_OK) {
        slave->state.phase = PHASE_CONTINUOUS_TIME;
    }
    return status;
}

void slave_enter_event_mode(struct slave *slave) {
    slave->state.phase = PHASE_STEPPING;
}

enum status slave_set_time(struct slave *slave, double time) {
    if (!isfinite(time)) {
        message_write(&slave->sink, STATUS_NOT_FINITE,
                      "time %g is refused: a finite time is expected", time);
        return STATUS_NOT_FINITE;
    }
    slave_set_clock(slave, (struct clock_time){.s = time});
    return STATUS_OK;
}
