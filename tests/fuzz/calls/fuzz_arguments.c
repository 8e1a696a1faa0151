#include "fuzz_arguments.h"

#include "model_description.h"

#include <stdlib.h>

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

/* ---- Arrays ---------------------------------------------------------------------------------- */

static void *arguments[8];
static size_t argument_count;

void *fuzz_argument(size_t count, size_t size) {
    if (argument_count == FUZZ_COUNT(arguments)) {
        fuzz_fail("a call has more arguments than %zu", argument_count);
    }
    return arguments[argument_count++] = fuzz_array(count, size);
}

void fuzz_free_arguments(void) {
    while (argument_count > 0) {
        free(arguments[--argument_count]);
    }
}

static size_t any_count(struct fuzz_input *input) {
    const unsigned selector = fuzz_byte(input);
    return selector < 160 ? 1 : selector % 8;
}

/* Mostly the number that belongs to the references. */
static size_t any_size(struct fuzz_input *input, size_t count) {
    const unsigned selector = fuzz_byte(input);
    return selector < 240 ? count : selector % 8;
}

static void choose(struct fuzz_input *input, struct fuzz_references *some, enum variable_type type,
                   bool sets) {
    some->at = fuzz_argument(some->count, sizeof *some->at);
    for (size_t i = 0; i < some->count; i++) {
        some->at[i] = any_reference(input, type, sets);
    }
}

struct fuzz_references fuzz_any(struct fuzz_input *input, enum variable_type type, bool sets) {
    struct fuzz_references some = {.count = any_count(input)};
    choose(input, &some, type, sets);
    return some;
}

struct fuzz_references fuzz_any_sized(struct fuzz_input *input, enum variable_type type,
                                      bool sets) {
    struct fuzz_references some = {.count = any_count(input)};
    some.size = any_size(input, some.count);
    choose(input, &some, type, sets);
    return some;
}

void fuzz_any_pair(struct fuzz_input *input, bool are_sized, struct fuzz_references *unknowns,
                   struct fuzz_references *knowns) {
    unknowns->count = any_count(input);
    knowns->count = any_count(input);
    if (are_sized) {
        unknowns->size = any_size(input, unknowns->count);
        knowns->size = any_size(input, knowns->count);
    }
    choose(input, unknowns, VARIABLE_FLOAT64, false);
    choose(input, knowns, VARIABLE_FLOAT64, false);
}

double *fuzz_any_reals(struct fuzz_input *input, size_t count) {
    double *values = fuzz_argument(count, sizeof *values);
    for (size_t i = 0; i < count; i++) {
        values[i] = fuzz_likely_real(input);
    }
    return values;
}

fmi2Integer *fuzz_any_integers(struct fuzz_input *input, size_t count) {
    fmi2Integer *values = fuzz_argument(count, sizeof *values);
    for (size_t i = 0; i < count; i++) {
        values[i] = fuzz_integer(input);
    }
    return values;
}

fmi2Integer *fuzz_any_orders(struct fuzz_input *input, size_t count) {
    fmi2Integer *orders = fuzz_argument(count, sizeof *orders);
    for (size_t i = 0; i < count; i++) {
        const unsigned selector = fuzz_byte(input);
        orders[i] = selector < 230 ? (fmi2Integer)(selector % 5) : fuzz_integer(input);
    }
    return orders;
}

double *fuzz_unwritten(size_t count) {
    double *values = fuzz_argument(count, sizeof *values);
    fuzz_poison(values, count);
    return values;
}

double fuzz_any_step(struct fuzz_input *input) {
    return fuzz_below(input, 16) != 15 ? fuzz_magnitude(input, 1e-6, 10.0) : fuzz_real(input);
}
