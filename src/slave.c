#include "slave.h"

#include "clock.h"
#include "integrator.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The integrator runs at this fraction of the tolerance asked for. Each restart, one per change of
 * an input, adds an error of the order of the local tolerance, and thousands of them add up:
 * measured over 5000 steps of 1 ms whose inputs all change, the error of the trajectory is 97 times
 * the tolerance asked for at a hundredth, 19 times at this fraction, for 8 % more internal steps.
 * Larger: faster and less accurate. */
static const double tolerance_fraction = 2e-3;

/* Bounds of what the integrator can run at: below, rounding stops its error test from converging;
 * above, results have no digit left. */
static const double finest_tolerance = 1e-14;
static const double coarsest_tolerance = 1e-2;

/* Absolute tolerance of a state, over relative tolerance times nominal value. */
static const double absolute_fraction = 1e-2;

struct slave {
    const struct unit *unit;
    const struct model *model;
    struct message_sink sink;
    enum phase phase;
    bool experiment_defined;
    struct slave_experiment experiment;

    struct slave_values own;
    char *values;           /* the model's value structure, as set and read from outside */
    bool outputs_are_valid; /* the calculated fields of values belong to its other fields */

    struct integrator *integrator; /* NULL where the model has no states */
    char *held;                    /* the value structure that the integrator runs with */
    bool has_history;              /* the integrator can go on from where it is */
    struct clock_time time;
    struct clock_time restart_time;
};

static double *states_of(const struct slave *slave) {
    return (double *)(void *)(slave->values + slave->model->states.offset);
}

static enum status rhs(double t, const double x[], double dx[], void *slave_pointer) {
    const struct slave *slave = slave_pointer;
    const double *u = (const double *)(void *)(slave->held + slave->model->inputs.offset);
    return slave->model->derivatives(slave->held, slave->restart_time.s + t, x, u, dx);
}

/* ---- Life ----------------------------------------------------------------------------------- */

static size_t state_count(const struct model *model) {
    return model->states.size / sizeof(double);
}

static enum status setup(struct slave *slave) {
    slave->values = calloc(1, slave->model->values_size);
    slave->held = calloc(1, slave->model->values_size);
    if (slave->values == NULL || slave->held == NULL) {
        return STATUS_OUT_OF_MEMORY;
    }
    if (slave->model->states.size == 0) {
        return STATUS_OK;
    }
    const struct ode ode = {.state_count = state_count(slave->model), .rhs = rhs, .context = slave};
    return integrator_create(&ode, &slave->sink, &slave->integrator);
}

enum status slave_create(const struct unit *unit, const struct message_sink *sink,
                         struct slave **slave) {
    *slave = NULL;
    struct slave *created = calloc(1, sizeof *created);
    enum status status = STATUS_OUT_OF_MEMORY;
    if (created != NULL) {
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
    integrator_destroy(slave->integrator);
    free(slave->held);
    free(slave->values);
    free(slave);
}

static void *field_of(struct slave *slave, const struct variable *variable) {
    char *structure =
        variable->owner == VARIABLE_OF_MODEL ? slave->values : (char *)(void *)&slave->own;
    return structure + variable->offset;
}

static void write_field(struct slave *slave, const struct variable *variable, double value) {
    if (variable->type == VARIABLE_REAL) {
        *(double *)field_of(slave, variable) = value;
    } else {
        *(int *)field_of(slave, variable) = (int)value;
    }
}

/* The parameter wins over the experiment, which wins over the unit's default. */
static void update_effective_tolerance(struct slave *slave) {
    double tolerance = slave->unit->default_tolerance;
    if (slave->own.relative_tolerance > 0.0) {
        tolerance = slave->own.relative_tolerance;
    } else if (slave->experiment.tolerance_defined) {
        tolerance = slave->experiment.tolerance;
    }
    slave->own.effective_relative_tolerance =
        fmin(fmax(tolerance_fraction * tolerance, finest_tolerance), coarsest_tolerance);
}

static void set_time(struct slave *slave, struct clock_time time) {
    slave->time = time;
    slave->own.time = time.s;
    slave->outputs_are_valid = false;
}

void slave_reset(struct slave *slave) {
    memset(slave->values, 0, slave->model->values_size);
    slave->own = (struct slave_values){0};
    for (size_t i = 0; i < slave->unit->variable_count; i++) {
        write_field(slave, &slave->unit->variables[i], slave->unit->variables[i].start);
    }
    slave->phase = PHASE_INSTANTIATED;
    slave->experiment_defined = false;
    slave->experiment = (struct slave_experiment){0};
    slave->has_history = false;
    set_time(slave, (struct clock_time){0});
    update_effective_tolerance(slave);
}

enum status slave_setup_experiment(struct slave *slave, const struct slave_experiment *experiment) {
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

    slave->experiment = *experiment;
    slave->experiment_defined = true;
    set_time(slave, (struct clock_time){.s = start});
    update_effective_tolerance(slave);
    return STATUS_OK;
}

enum status slave_enter_initialization(struct slave *slave) {
    if (!slave->experiment_defined) {
        message_write(&slave->sink, STATUS_INVALID_ARGUMENT,
                      "initialization is refused: the experiment must be set up first");
        return STATUS_INVALID_ARGUMENT;
    }
    slave->phase = PHASE_INITIALIZATION;
    return STATUS_OK;
}

static enum status check_parameters(const struct slave *slave) {
    char text[256] = "";
    const enum status status = slave->model->check_parameters(slave->values, text, sizeof text);
    if (status != STATUS_OK) {
        message_write(&slave->sink, status, "%s", text);
    }
    return status;
}

static enum status configure_integrator(struct slave *slave) {
    double *tolerances = (double *)(void *)(slave->held + slave->model->states.offset);
    for (size_t i = 0; i < slave->unit->variable_count; i++) {
        const struct variable *variable = &slave->unit->variables[i];
        const size_t from_states = variable->offset - slave->model->states.offset;
        if (variable->owner == VARIABLE_OF_MODEL && from_states < slave->model->states.size) {
            tolerances[from_states / sizeof(double)] =
                absolute_fraction * variable->nominal * slave->own.effective_relative_tolerance;
        }
    }
    const struct integrator_settings settings = {
        .relative_tolerance = slave->own.effective_relative_tolerance,
        .absolute_tolerances = tolerances,
        .max_steps = slave->own.max_internal_steps,
    };
    const enum status status = integrator_configure(slave->integrator, &settings);
    if (status != STATUS_OK) {
        message_write(&slave->sink, status, "initialization failed: %s", status_text(status));
    }
    return status;
}

enum status slave_exit_initialization(struct slave *slave) {
    enum status status = check_parameters(slave);
    if (status == STATUS_OK && slave->integrator != NULL) {
        status = configure_integrator(slave);
    }
    if (status == STATUS_OK) {
        slave->phase = PHASE_STEPPING;
        slave->has_history = false;
    }
    return status;
}

/* ---- Values --------------------------------------------------------------------------------- */

/* The variable with this reference and type, or NULL with a text. */
static const struct variable *find(const struct slave *slave, unsigned reference,
                                   enum variable_type type) {
    const struct variable *variable = variable_find(slave->unit, reference);
    if (variable == NULL) {
        message_write(&slave->sink, STATUS_INVALID_ARGUMENT,
                      "value reference %u is unknown: %s has no such variable", reference,
                      slave->unit->name);
        return NULL;
    }
    if (variable->type != type) {
        message_write(&slave->sink, STATUS_INVALID_ARGUMENT,
                      "%s (value reference %u) is accessed as %s: it is of type %s", variable->name,
                      reference, variable_type_name(type), variable_type_name(variable->type));
        return NULL;
    }
    return variable;
}

static const struct variable *find_settable(const struct slave *slave, unsigned reference,
                                            enum variable_type type) {
    const struct variable *variable = find(slave, reference, type);
    if (variable != NULL && !variable_is_settable(variable, slave->phase)) {
        message_write(&slave->sink, STATUS_INVALID_ARGUMENT,
                      "%s (value reference %u) cannot be set %s", variable->name, reference,
                      slave->phase == PHASE_STEPPING
                          ? "after initialization: only inputs and tunable parameters can"
                          : "at all: only start values and inputs can");
        return NULL;
    }
    return variable;
}

/* Element i of an array of the C type that belongs to type; every int is exact as a double. */
static double element(enum variable_type type, const void *values, size_t i) {
    return type == VARIABLE_REAL ? ((const double *)values)[i] : ((const int *)values)[i];
}

static enum status set(struct slave *slave, enum variable_type type, const unsigned references[],
                       size_t count, const void *values) {
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable = find_settable(slave, references[i], type);
        if (variable == NULL) {
            return STATUS_INVALID_ARGUMENT;
        }
        const enum status status =
            variable_check_value(variable, element(type, values, i), &slave->sink);
        if (status != STATUS_OK) {
            return status;
        }
    }
    for (size_t i = 0; i < count; i++) {
        write_field(slave, variable_find(slave->unit, references[i]), element(type, values, i));
    }
    slave->outputs_are_valid = false;
    update_effective_tolerance(slave);
    return STATUS_OK;
}

enum status slave_set_real(struct slave *slave, const unsigned references[], size_t count,
                           const double values[]) {
    return set(slave, VARIABLE_REAL, references, count, values);
}

enum status slave_set_integer(struct slave *slave, const unsigned references[], size_t count,
                              const int values[]) {
    return set(slave, VARIABLE_INTEGER, references, count, values);
}

static enum status update_outputs(struct slave *slave) {
    if (slave->outputs_are_valid) {
        return STATUS_OK;
    }
    const enum status status = slave->model->outputs(slave->values, slave->time.s);
    slave->outputs_are_valid = status == STATUS_OK;
    if (status != STATUS_OK) {
        message_write(&slave->sink, status, "no outputs at t = %.17g: %s", slave->time.s,
                      status_text(status));
    }
    return status;
}

enum status slave_get_real(struct slave *slave, const unsigned references[], size_t count,
                           double values[]) {
    for (size_t i = 0; i < count; i++) {
        const struct variable *variable = find(slave, references[i], VARIABLE_REAL);
        if (variable == NULL) {
            return STATUS_INVALID_ARGUMENT;
        }
        if (variable->initial == INITIAL_CALCULATED && variable->owner == VARIABLE_OF_MODEL) {
            const enum status status = update_outputs(slave);
            if (status != STATUS_OK) {
                return status;
            }
        }
        if (!isfinite(*(const double *)field_of(slave, variable))) {
            message_write(&slave->sink, STATUS_NOT_FINITE,
                          "%s at t = %.17g is not finite: parameters, states and inputs are too "
                          "extreme to compute it",
                          variable->name, slave->time.s);
            return STATUS_NOT_FINITE;
        }
    }
    for (size_t i = 0; i < count; i++) {
        values[i] = *(const double *)field_of(slave, variable_find(slave->unit, references[i]));
    }
    return STATUS_OK;
}

enum status slave_get_integer(struct slave *slave, const unsigned references[], size_t count,
                              int values[]) {
    for (size_t i = 0; i < count; i++) {
        if (find(slave, references[i], VARIABLE_INTEGER) == NULL) {
            return STATUS_INVALID_ARGUMENT;
        }
    }
    for (size_t i = 0; i < count; i++) {
        values[i] = *(const int *)field_of(slave, variable_find(slave->unit, references[i]));
    }
    return STATUS_OK;
}

/* ---- Steps ---------------------------------------------------------------------------------- */

static enum status refuse_times(const struct slave *slave, double t, double h) {
    if (!isfinite(t) || !isfinite(h) || !(h > 0.0) || !isfinite(t + h)) {
        message_write(&slave->sink, STATUS_INVALID_TIME,
                      "a step of %g s from t = %.17g is refused: a finite time and a step above 0 "
                      "are expected",
                      h, t);
        return STATUS_INVALID_TIME;
    }
    if (t + h == t) {
        message_write(&slave->sink, STATUS_INVALID_TIME,
                      "a step of %g s from t = %.17g is refused: it does not change the time", h,
                      t);
        return STATUS_INVALID_TIME;
    }
    const double mismatch = clock_difference((struct clock_time){.s = t}, slave->time);
    if (!(fabs(mismatch) <= clock_slack(t, h)) || !(mismatch + h > 0.0)) {
        message_write(&slave->sink, STATUS_INVALID_TIME,
                      "a step from t = %.17g is refused: the instance is at t = %.17g", t,
                      slave->time.s);
        return STATUS_INVALID_TIME;
    }
    if (slave->experiment.stop_time_defined &&
        t + h - slave->experiment.stop_time > clock_slack(t + h, h)) {
        message_write(&slave->sink, STATUS_INVALID_TIME,
                      "a step from t = %.17g to t = %.17g is refused: the stop time is %.17g", t,
                      t + h, slave->experiment.stop_time);
        return STATUS_INVALID_TIME;
    }
    return STATUS_OK;
}

static bool has_changed(const struct slave *slave, struct span span) {
    return memcmp(slave->held + span.offset, slave->values + span.offset, span.size) != 0;
}

/* A pure function of what is set now and what the integrator runs with: how often and in what order
 * values were set does not matter. */
static enum status restart_if_changed(struct slave *slave) {
    if (slave->has_history && !has_changed(slave, slave->model->parameters) &&
        !has_changed(slave, slave->model->inputs)) {
        return STATUS_OK;
    }
    memcpy(slave->held, slave->values, slave->model->values_size);
    slave->restart_time = slave->time;
    slave->has_history = true;
    const struct clock_time stop = {.s = slave->experiment.stop_time};
    const double span = slave->experiment.stop_time_defined
                            ? clock_difference(stop, slave->restart_time)
                            : INFINITY;
    return integrator_restart(slave->integrator, states_of(slave), span);
}

static int saturated(long count) {
    return count > INT_MAX ? INT_MAX : (int)count;
}

static void update_statistics(struct slave *slave) {
    struct integrator_statistics statistics;
    integrator_get_statistics(slave->integrator, &statistics);
    slave->own.solver_steps = saturated(statistics.steps);
    slave->own.solver_rhs_evaluations = saturated(statistics.rhs_evaluations);
}

static enum status integrate_to(struct slave *slave, struct clock_time end) {
    enum status status = restart_if_changed(slave);
    if (status != STATUS_OK) {
        return status;
    }
    double reached;
    const double target = clock_difference(end, slave->restart_time);
    status = integrator_advance(slave->integrator, target, &reached, states_of(slave));
    set_time(slave, status == STATUS_OK ? end : clock_add(slave->restart_time, reached));
    update_statistics(slave);
    return status;
}

enum status slave_do_step(struct slave *slave, double communication_point, double step) {
    enum status status = refuse_times(slave, communication_point, step);
    if (status == STATUS_OK) {
        status = check_parameters(slave);
    }
    if (status != STATUS_OK) {
        return status;
    }

    const struct clock_time end = clock_add((struct clock_time){.s = communication_point}, step);
    if (slave->integrator == NULL) {
        set_time(slave, end);
        return STATUS_OK;
    }
    status = integrate_to(slave, end);
    if (status != STATUS_OK) {
        message_write(&slave->sink, status,
                      "the step from t = %.17g to t = %.17g ended at %.17g: %s",
                      communication_point, end.s, slave->time.s, status_text(status));
    }
    return status;
}

double slave_time(const struct slave *slave) {
    return slave->time.s;
}
