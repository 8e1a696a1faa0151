#include "fuzz_model.h"

#include <math.h>
#include <string.h>

/* ---- What a variable is set to --------------------------------------------------------------- */

/* Settings of the instance that limit its work: executions have to be quick. */
static bool is_limit(const struct variable *variable) {
    return variable->owner == VARIABLE_OF_INSTANCE && variable->type == VARIABLE_INT32 &&
           variable->causality == CAUSALITY_PARAMETER;
}

static double within(const struct variable *variable, double value) {
    return fmin(fmax(value, variable->min), variable->max);
}

/* Up to a thousand times as large, or as small, as the start value; of either sign. */
static double usual_real(struct fuzz_input *input, const struct variable *variable) {
    const double scale = variable->start != 0.0 ? fabs(variable->start) : variable->nominal;
    const double value = scale * fuzz_magnitude(input, 1e-3, 1e3);
    return within(variable, fuzz_below(input, 2) == 0 ? value : -value);
}

static double any_real(struct fuzz_input *input, const struct variable *variable, bool *is_usual) {
    const unsigned selector = fuzz_below(input, 16);
    double value;
    switch (selector) {
    case 0:
        return variable->start;
    case 1:
        return isfinite(variable->min) ? variable->min : 0.0;
    case 2: // for those with a range on both sides, its end
        *is_usual &= isfinite(variable->max) && variable->max <= 1e3;
        return variable->max;
    case 3:
        value = fuzz_real(input);
        *is_usual = *is_usual && fabs(value) <= 1e3 && (value == 0.0 || fabs(value) >= 1e-3);
        return value;
    default:
        return usual_real(input, variable);
    }
}

static int any_integer(struct fuzz_input *input, const struct variable *variable) {
    const double range = variable->max - variable->min;
    const unsigned selector = fuzz_below(input, 16);
    if (is_limit(variable)) {
        return selector == 0 ? -(int)fuzz_below(input, 2) : 1 + (int)fuzz_below(input, 250);
    }
    if (selector == 0) {
        return fuzz_integer(input);
    }
    if (variable->type == VARIABLE_BOOLEAN) {
        return (int)fuzz_below(input, 2);
    }
    return range < 256.0 ? (int)variable->min + (int)fuzz_below(input, (unsigned)range + 1)
                         : (int)fuzz_byte(input) - 128;
}

/* ---- Setting --------------------------------------------------------------------------------- */

/* In Model Exchange importers set states as variables: in continuous-time mode, and in FMI 3.0 in
 * event mode too. */
static bool is_free_state(const struct subject *subject, const struct variable *variable) {
    const struct range states = model_description.model->states;
    return (fmu_version == 3 || subject->phase == PHASE_CONTINUOUS_TIME) &&
           subject->instance->kind == fmi2ModelExchange && variable->owner == VARIABLE_OF_MODEL &&
           variable->offset >= states.offset && variable->offset - states.offset < states.size;
}

static bool is_settable(const struct subject *subject, const struct variable *variable) {
    return variable_is_settable(variable, subject->phase) || is_free_state(subject, variable);
}

static bool may_be_set(const struct subject *subject, const struct variable *variable,
                       double value) {
    return is_settable(subject, variable) && isfinite(value) && value >= variable->min &&
           value <= variable->max;
}

/* A value of any type as a double; *is_usual is cleared where its magnitude is not usual. */
static double any_value(struct fuzz_input *input, const struct variable *variable, bool *is_usual) {
    if (variable->type == VARIABLE_FLOAT64) {
        return any_real(input, variable, is_usual);
    }
    const int number = any_integer(input, variable);
    return variable->type == VARIABLE_BOOLEAN ? number != 0 : number;
}

static fmi2Status set(struct fuzz_instance *instance, const struct variable *variable,
                      double value) {
    if (variable->type == VARIABLE_FLOAT64) {
        return FUZZ_CHECKED(instance, SetReal, &variable->reference, 1, &value);
    }
    const int number = (int)value;
    return variable->type == VARIABLE_BOOLEAN
               ? FUZZ_CHECKED(instance, SetBoolean, &variable->reference, 1, &number)
               : FUZZ_CHECKED(instance, SetInteger, &variable->reference, 1, &number);
}

static const struct variable *choose_variable(struct subject *subject) {
    const struct variable *settable[FUZZ_VARIABLE_CAPACITY];
    const struct variable *all = model_description.variables;
    const unsigned selector = fuzz_byte(subject->input);
    size_t count = 0;
    for (size_t i = 0; i < model_description.variable_count; i++) {
        if (is_settable(subject, &all[i])) {
            settable[count++] = &all[i];
        }
    }
    return selector >= 240 || count == 0 ? &all[selector % model_description.variable_count]
                                         : settable[selector % count];
}

/* All that an instance can be asked for now. */
static void read_allowed(const struct subject *subject, struct fuzz_values *values) {
    memset(values, 0, sizeof *values);
    if (subject->phase != PHASE_INSTANTIATED) { // values are given from initialization on
        fuzz_read(subject->instance, values);
    }
}

/* A variable that cannot be set is an error, a value that it cannot have is discarded. Either
 * changes nothing, and leaves no trace after a rollback. */
static void set_refused(const struct subject *subject, const struct variable *variable,
                        double value) {
    struct fuzz_instance *instance = subject->instance;
    static struct fuzz_bytes bytes[2];
    struct fuzz_values before;
    struct fuzz_values after;
    fmi2FMUstate state = fuzz_save(subject->instance);
    fuzz_serialize(instance, &bytes[0]);
    read_allowed(subject, &before);
    const fmi2Status status = set(instance, variable, value);
    if (status != (is_settable(subject, variable) ? fmi2Discard : fmi2Error)) {
        fuzz_fail("%s = %.17g has the status %d in phase %d", variable->name, value, (int)status,
                  (int)subject->phase);
    }
    read_allowed(subject, &after);
    fuzz_assert_same(&before, &after, "after a value that was refused");
    fuzz_restore(subject->instance, state, instance->time);
    fuzz_serialize(instance, &bytes[1]);
    if (!fuzz_are_same_bytes(&bytes[0], &bytes[1])) {
        fuzz_fail("%s = %.17g was refused, and a rollback leaves a trace", variable->name, value);
    }
    fuzz_forget(subject->instance, &state);
}

void fuzz_model_set_any(struct subject *subject) {
    const struct variable *variable = choose_variable(subject);
    bool is_usual = true;
    const double value = any_value(subject->input, variable, &is_usual);
    if (!may_be_set(subject, variable, value)) {
        set_refused(subject, variable, value);
        return;
    }
    fuzz_require(set(subject->instance, variable, value), subject->instance, variable->name);
    subject->is_usual &= is_usual;
    subject->is_inconsistent |= variable->causality == CAUSALITY_PARAMETER;
}

size_t fuzz_model_references(enum causality causality, fmi2ValueReference references[]) {
    size_t count = 0;
    for (size_t i = 0; i < model_description.variable_count; i++) {
        const struct variable *variable = &model_description.variables[i];
        if (variable->causality == causality && variable->type == VARIABLE_FLOAT64 &&
            variable->variability == VARIABILITY_CONTINUOUS) {
            references[count++] = variable->reference;
        }
    }
    return count;
}

void fuzz_model_set_inputs(struct subject *subject) {
    fmi2ValueReference references[FUZZ_VARIABLE_CAPACITY];
    fmi2Real values[FUZZ_VARIABLE_CAPACITY];
    const size_t count = fuzz_model_references(CAUSALITY_INPUT, references);
    for (size_t i = 0; i < count; i++) {
        values[i] = usual_real(subject->input, variable_of(&model_description, references[i]));
    }
    fuzz_require(FUZZ_CHECKED(subject->instance, SetReal, references, count, values),
                 subject->instance, "fmi2SetReal of all inputs");
}

/* ---- Reading --------------------------------------------------------------------------------- */

void fuzz_model_derive(struct subject *subject) {
    fmi2ValueReference outputs[FUZZ_VARIABLE_CAPACITY];
    fmi2ValueReference inputs[FUZZ_VARIABLE_CAPACITY];
    fmi2Integer orders[FUZZ_VARIABLE_CAPACITY];
    fmi2Real seed[FUZZ_VARIABLE_CAPACITY];
    fmi2Real values[FUZZ_VARIABLE_CAPACITY];
    const size_t output_count = fuzz_model_references(CAUSALITY_OUTPUT, outputs);
    const size_t input_count = fuzz_model_references(CAUSALITY_INPUT, inputs);
    for (size_t i = 0; i < input_count; i++) {
        seed[i] = fuzz_likely_real(subject->input);
    }
    for (size_t i = 0; i < output_count; i++) {
        orders[i] = 1 + (fmi2Integer)fuzz_below(subject->input, 2);
    }
    fuzz_poison(values, output_count);
    fmi2Status status = FUZZ_CHECKED(subject->instance, GetDirectionalDerivative, outputs,
                                     output_count, inputs, input_count, seed, values);
    fuzz_assert_written(status, values, output_count, "fmi2GetDirectionalDerivative");
    if (status == fmi2Error || subject->instance->kind == fmi2ModelExchange) {
        return;
    }
    fuzz_poison(values, output_count);
    status = FUZZ_CHECKED(subject->instance, GetRealOutputDerivatives, outputs, output_count,
                          orders, values);
    fuzz_assert_written(status, values, output_count, "fmi2GetRealOutputDerivatives");
}

void fuzz_model_read(struct subject *subject, struct fuzz_values *values) {
    fuzz_read(subject->instance, values);
    if (subject->is_usual && values->status != fmi2OK) {
        fuzz_fail("a value cannot be computed though usual ones were set: %s",
                  subject->instance->text);
    }
}
