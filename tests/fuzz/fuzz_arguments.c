#include "fuzz_arguments.h"

#include "model_description.h"

/* Mostly one of this type, and of those that can be set between steps where one is to be set. */
static fmi2ValueReference any_reference(struct fuzz_input *input, enum variable_type type,
                                        bool sets) {
    const unsigned selector = fuzz_byte(input);
    if (selector >= 248) {
        return selector < 252 ? 9 * (selector - 247) : (fmi2ValueReference)fuzz_word(input);
    }
    const struct variable *variable =
        &model_description.variables[selector % model_description.variable_count];
    for (size_t i = 0; i < model_description.variable_count && selector < 216; i++) {
        variable = &model_description.variables[(selector + i) % model_description.variable_count];
        if (variable->type == type && (!sets || variable_is_settable(variable, PHASE_STEPPING))) {
            break;
        }
    }
    return variable->reference;
}

size_t fuzz_any_count(struct fuzz_input *input) {
    const unsigned selector = fuzz_byte(input);
    return selector < 160 ? 1 : selector % 8;
}

fmi2ValueReference *fuzz_any_references(struct fuzz_input *input, size_t count,
                                        enum variable_type type, bool sets) {
    fmi2ValueReference *references = fuzz_array(count, sizeof *references);
    for (size_t i = 0; i < count; i++) {
        references[i] = any_reference(input, type, sets);
    }
    return references;
}

double *fuzz_any_reals(struct fuzz_input *input, size_t count) {
    double *values = fuzz_array(count, sizeof *values);
    for (size_t i = 0; i < count; i++) {
        values[i] = fuzz_likely_real(input);
    }
    return values;
}

fmi2Integer *fuzz_any_integers(struct fuzz_input *input, size_t count) {
    fmi2Integer *values = fuzz_array(count, sizeof *values);
    for (size_t i = 0; i < count; i++) {
        values[i] = fuzz_integer(input);
    }
    return values;
}

fmi2Integer *fuzz_any_orders(struct fuzz_input *input, size_t count) {
    fmi2Integer *orders = fuzz_array(count, sizeof *orders);
    for (size_t i = 0; i < count; i++) {
        const unsigned selector = fuzz_byte(input);
        orders[i] = selector < 230 ? (fmi2Integer)(selector % 5) : fuzz_integer(input);
    }
    return orders;
}

double *fuzz_unwritten(size_t count) {
    double *values = fuzz_array(count, sizeof *values);
    fuzz_poison(values, count);
    return values;
}

double fuzz_any_step(struct fuzz_input *input) {
    return fuzz_below(input, 16) != 15 ? fuzz_magnitude(input, 1e-6, 10.0) : fuzz_real(input);
}
