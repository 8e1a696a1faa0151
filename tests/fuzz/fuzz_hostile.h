/* Calls with hostile arguments, as the input says: what fuzz_hostile.c and the calls that only one
 * version of FMI has share. */
#ifndef FUZZ_HOSTILE_H
#define FUZZ_HOSTILE_H

#include "fuzz_instance.h"
#include "variables.h"

/* One call, in whatever state the instance is, and what holds for it. */
typedef void fuzz_hostile_call(struct fuzz_input *input, struct fuzz_instance *instance);

/* Those of one version: fuzz_model_fmi2.c, fuzz_hostile_fmi3.c. */
struct fuzz_hostile_calls {
    size_t count;
    fuzz_hostile_call *const *calls;
};
extern const struct fuzz_hostile_calls fuzz_version_calls;

/* An array with nothing behind it that may be touched; valid until the call is over. */
void *fuzz_argument(size_t count, size_t size);

/* 0 to 7 references, mostly 1. */
struct fuzz_references {
    size_t count;
    size_t size; /* of the values in FMI 3.0: mostly the same */
    fmi2ValueReference *at;
};

/* Mostly of variables of this type, to be read, or to be set: of those that can be set between
 * steps. */
struct fuzz_references fuzz_any(struct fuzz_input *input, enum variable_type type, bool sets);

double *fuzz_any_reals(struct fuzz_input *input, size_t count);

/* Of derivatives, mostly small. */
fmi2Integer *fuzz_any_orders(struct fuzz_input *input, size_t count);

/* An array of poison, to see what a call writes. */
double *fuzz_unwritten(size_t count);

/* Where a step begins, mostly where the instance is, and its length (s). */
double fuzz_any_point(struct fuzz_input *input, const struct fuzz_instance *instance);
double fuzz_any_length(struct fuzz_input *input);

#endif
