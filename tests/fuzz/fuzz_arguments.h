/* Arguments of calls, as the input says; arrays are freed with free(). */
#ifndef FUZZ_ARGUMENTS_H
#define FUZZ_ARGUMENTS_H

#include "fuzz_instance.h"
#include "variables.h"

/* Mostly few, mostly not none. */
size_t fuzz_any_count(struct fuzz_input *input);

/* Mostly of variables of this type, and of those that can be set between steps where they are to be
 * set. */
fmi2ValueReference *fuzz_any_references(struct fuzz_input *input, size_t count,
                                        enum variable_type type, bool sets);

double *fuzz_any_reals(struct fuzz_input *input, size_t count);
fmi2Integer *fuzz_any_integers(struct fuzz_input *input, size_t count);

/* Of derivatives, mostly small. */
fmi2Integer *fuzz_any_orders(struct fuzz_input *input, size_t count);

/* Poisoned. */
double *fuzz_unwritten(size_t count);

/* Length of a step, s. */
double fuzz_any_step(struct fuzz_input *input);

#endif
