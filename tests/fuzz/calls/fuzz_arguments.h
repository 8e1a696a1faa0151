/* Arguments of calls, as the input says. */
#ifndef FUZZ_ARGUMENTS_H
#define FUZZ_ARGUMENTS_H

#include "fuzz_instance.h"
#include "variables.h"

/* An array with nothing behind it that may be touched; valid until the call is over. */
void *fuzz_argument(size_t count, size_t size);
void fuzz_free_arguments(void);

/* Mostly few, mostly not none. */
struct fuzz_references {
    size_t count;
    size_t size; /* of the values in FMI 3.0: mostly the same */
    fmi2ValueReference *at;
};

/* Mostly of variables of this type, to be read, or to be set: of those that can be set between
 * steps. */
struct fuzz_references fuzz_any(struct fuzz_input *input, enum variable_type type, bool sets);
struct fuzz_references fuzz_any_sized(struct fuzz_input *input, enum variable_type type, bool sets);

/* Of a derivative. */
void fuzz_any_pair(struct fuzz_input *input, bool are_sized, struct fuzz_references *unknowns,
                   struct fuzz_references *knowns);

double *fuzz_any_reals(struct fuzz_input *input, size_t count);
fmi2Integer *fuzz_any_integers(struct fuzz_input *input, size_t count);

/* Of derivatives, mostly small. */
fmi2Integer *fuzz_any_orders(struct fuzz_input *input, size_t count);

/* Poisoned. */
double *fuzz_unwritten(size_t count);

/* Length of a step, s. */
double fuzz_any_step(struct fuzz_input *input);

#endif
