/* Random sequences of what a co-simulation master does with an instance: start values,
 * initialization, then inputs, their derivatives, tunable parameters and steps of many lengths. The
 * same seed gives the same sequence on every machine. */
#ifndef FMU_SEQUENCES_H
#define FMU_SEQUENCES_H

#include "fmu_harness.h"

#include <stdint.h>

/* ---- Random numbers ------------------------------------------------------------------------- */

struct fmu_random {
    uint64_t state;
};

unsigned fmu_random_below(struct fmu_random *random, unsigned count);
double fmu_random_between(struct fmu_random *random, double low, double high);

/* ---- Sequences ------------------------------------------------------------------------------ */

enum fmu_operation_kind {
    FMU_SET,         /* reference = value */
    FMU_SET_INTEGER, /* reference = order */
    FMU_DERIVE,      /* derivative of this order of the input reference = value, per s^order */
    FMU_SETUP,       /* start at point (s), stop at value (s) where that is finite */
    FMU_ENTER,       /* initialization mode, with the point and value of FMU_SETUP */
    FMU_EXIT,
    FMU_STEP, /* from point to point + value (s) */
};

struct fmu_operation {
    enum fmu_operation_kind kind;
    fmi2ValueReference reference;
    fmi2Integer order;
    double point, value;
};

enum { FMU_SEQUENCE_CAPACITY = 96 };

struct fmu_sequence {
    struct fmu_operation operations[FMU_SEQUENCE_CAPACITY];
    size_t count;
    size_t readable_from; /* variables can be read after this operation and all later ones */
    double end;           /* s: time after the last operation */
};

/* The method of integration, one of all, goes with the seed: seed % 3 is enough to run them all. In
 * every fourth the internal steps are limited; in every tenth, steps may fail for want of them;
 * every 25th begins with thousands of them in which nothing is set. */
void fmu_sequence_make(struct fmu_sequence *sequence, unsigned seed);

/* An instance initialized at 0 s in a motion in which nothing has to be set for thousands of
 * internal steps, because it does not slow down. */
fmi2Component fmu_lasting(fmi2Integer method, struct fmu_log *log);

fmi2Status fmu_apply(fmi2Component component, const struct fmu_operation *operation);

/* Set, derive or step, at this time (s), which a step moves on. */
struct fmu_operation fmu_random_operation(struct fmu_random *random, double *time);

/* ---- Traces --------------------------------------------------------------------------------- */

/* What each operation returned, and the values after it. */
struct fmu_trace {
    size_t count; /* up to the first operation that did not return fmi2OK, or all */
    fmi2Status statuses[FMU_SEQUENCE_CAPACITY];
    struct fmu_values values[FMU_SEQUENCE_CAPACITY];
};

/* The trace of an instance that was just made or reset. */
void fmu_sequence_run(fmi2Component component, const struct fmu_sequence *sequence,
                      struct fmu_trace *trace);

/* Applies operation number at; what it returns, and all values after it, must be as in the trace.
 */
void fmu_sequence_check(fmi2Component component, const struct fmu_sequence *sequence, size_t at,
                        const struct fmu_trace *expected, const char *message);

#endif
