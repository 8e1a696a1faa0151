#include "state.h"

#include <math.h>
#include <string.h>

const struct variable *instance_refuse_reference(const struct instance *instance,
                                                 unsigned reference, enum variable_type type) {
    const struct variable *variable = variable_find(instance->description, reference);
    if (variable == NULL) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "value reference %u is unknown: %s has no such variable", reference,
                      instance->description->name);
    } else {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "%s (value reference %u) is accessed as %s: it is of type %s", variable->name,
                      reference, variable_type_name(type), variable_type_name(variable->type));
    }
    return NULL;
}

enum status instance_not_finite(const struct instance *instance, const char *what) {
    message_write(&instance->sink, STATUS_NOT_FINITE,
                  "%s at t = %.17g is not finite: parameters, states and inputs are too extreme to "
                  "compute it",
                  what, instance->state.time.s);
    return STATUS_NOT_FINITE;
}

/* ---- Anchors -------------------------------------------------------------------------------- */

/* Searches, at most, until one finds what it began at: rounding moves a solution once or twice. */
enum { MOST_SEARCHES = 5 };

void instance_move_anchors(struct instance *instance) {
    const struct model *model = instance->model;
    if (model->anchor == NULL) {
        return;
    }
    char *values = instance->memory.values;
    double *anchors = doubles_of(values, model->anchors);
    double *before = doubles_of(instance->first_derivatives, model->anchors);
    int count = 0;
    do {
        memcpy(before, anchors, model->anchors.size);
        for (enum model_search search = SEARCH_FREE; search >= SEARCH_FAR; search--) {
            model->anchor(values, instance->state.time.s, doubles_of(values, model->states),
                          doubles_of(values, model->inputs), search, anchors);
        }
    } while (++count < MOST_SEARCHES && memcmp(before, anchors, model->anchors.size) != 0);
    instance->outputs_are_valid = false;
}

/* ---- Settings ------------------------------------------------------------------------------- */

enum status instance_check_experiment(const struct instance *instance,
                                      const struct instance_experiment *experiment) {
    const double start = experiment->start_time;
    if (!isfinite(start)) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "start time %g is refused: a finite time is expected", start);
        return STATUS_INVALID_ARGUMENT;
    }
    if (experiment->stop_time_defined &&
        !(isfinite(experiment->stop_time) && experiment->stop_time >= start)) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "stop time %.17g is refused: a finite time, not before the start time %.17g, "
                      "is expected",
                      experiment->stop_time, start);
        return STATUS_INVALID_ARGUMENT;
    }
    if (experiment->tolerance_defined &&
        !(isfinite(experiment->tolerance) && experiment->tolerance > 0.0)) {
        message_write(&instance->sink, STATUS_INVALID_ARGUMENT,
                      "tolerance %g is refused: a finite value above 0 is expected",
                      experiment->tolerance);
        return STATUS_INVALID_ARGUMENT;
    }
    return STATUS_OK;
}

enum status instance_check_parameters(struct instance *instance) {
    if (instance->parameters_are_valid) {
        return STATUS_OK;
    }
    char text[512]; // written if the parameters are refused
    const enum status status =
        instance->model->check_parameters(instance->memory.values, text, sizeof text);
    if (status != STATUS_OK) {
        message_write(&instance->sink, status, "%s", text);
    }
    instance->parameters_are_valid = status == STATUS_OK;
    return status;
}

/* Writes the absolute tolerance of each state, in its unit. */
static void write_absolute_tolerances(const struct instance *instance, double absolute[]) {
    const struct range states = instance->model->states;
    const double tolerance = instance->state.own.effective_relative_tolerance;
    for (size_t i = 0; i < instance->description->variable_count; i++) {
        const struct variable *variable = &instance->description->variables[i];
        const size_t from_states = variable->offset - states.offset;
        if (variable->owner == VARIABLE_OF_MODEL && from_states < states.size) {
            absolute[from_states / sizeof(double)] =
                INSTANCE_ABSOLUTE_FRACTION * variable->nominal * tolerance;
        }
    }
}

/* The parameter takes precedence over the experiment, and this over the default. */
double instance_requested_tolerance(const struct instance *instance,
                                    const struct instance_state *state) {
    if (state->own.relative_tolerance > 0.0) {
        return state->own.relative_tolerance;
    }
    return state->experiment.tolerance_defined
               ? fmin(state->experiment.tolerance, INSTANCE_COARSEST_EXPERIMENT_TOLERANCE)
               : instance->description->default_tolerance;
}

double instance_tolerance(const struct instance *instance, const struct instance_state *state) {
    const enum integrator_method method = (enum integrator_method)state->own.solver_method;
    const double tolerance = instance_requested_tolerance(instance, state);
    return fmin(fmax(integrator_tolerance_fraction(method) * tolerance, INSTANCE_FINEST_TOLERANCE),
                INSTANCE_COARSEST_TOLERANCE);
}

void instance_update_tolerance(struct instance *instance) {
    struct instance_state *state = &instance->state;
    state->own.effective_relative_tolerance = instance_tolerance(instance, state);
    if (instance->absolute_tolerances != NULL) {
        write_absolute_tolerances(instance, instance->absolute_tolerances);
    }
}

static struct integrator_settings settings_of(const struct instance *instance) {
    const struct instance_values *own = &instance->state.own;
    return (struct integrator_settings){
        .method = (enum integrator_method)own->solver_method,
        .relative_tolerance = own->effective_relative_tolerance,
        .max_step = own->max_step,
    };
}

bool instance_is_configured_otherwise(const struct instance *instance) {
    const struct integrator_settings wanted = settings_of(instance);
    return instance->configured.method != wanted.method ||
           instance->configured.relative_tolerance != wanted.relative_tolerance ||
           instance->configured.max_step != wanted.max_step;
}

enum status instance_configure_integrator(struct instance *instance) {
    const struct range states = instance->model->states;
    double *absolute = doubles_of(instance->first_derivatives, states);
    write_absolute_tolerances(instance, absolute);
    struct integrator_settings settings = settings_of(instance);
    settings.absolute_tolerances = absolute;
    const enum status status = integrator_configure(instance->integrator, &settings);
    instance->configured = status == STATUS_OK ? settings : (struct integrator_settings){0};
    instance->configured.absolute_tolerances = NULL;
    return status;
}
