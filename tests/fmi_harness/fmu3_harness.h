/* For tests that call the functions of FMI 3.0 themselves: an importer with intermediate updates,
 * on instances of fmu_harness.h. Link fmu3_fixture. */
#ifndef FMU3_HARNESS_H
#define FMU3_HARNESS_H

#include "fmu_fmi3.h"
#include "fmu_harness.h"

/* ---- Instances ------------------------------------------------------------------------------ */

/* What an intermediate update says. */
struct fmu3_update {
    double time;
    bool set, get, finished, can_return_early;
    bool *return_early;
    double *early_time;
};

/* Of the running test. */
extern struct fmu3_importer {
    /* Called in intermediate updates; NULL: they are only counted. */
    void (*update)(struct fmu3_importer *importer, const struct fmu3_update *update);
    unsigned updates;
    fmi2Component component; /* the last one made */
    fmi3Instance instance;   /* its own */
    void *data;              /* of update */
} importer;

struct fmu3_options {
    bool event_mode, early_return, intermediate_updates;
    const fmi3ValueReference *required; /* variables of intermediate updates */
    size_t required_count;
};

/* Instances of Co-Simulation and Model Exchange that log to messages, without logEvents and logAll;
 * tearDown frees them where the test did not. Options NULL: none. */
fmi3Instance fmu3_co_simulation(const struct fmu3_options *options);
fmi3Instance fmu3_model_exchange(void);
void fmu3_free(fmi3Instance instance);

/* Through initialization mode, from start (s); no tolerance and no stop time. */
void fmu3_initialize(fmi3Instance instance, double start);

/* ---- Values --------------------------------------------------------------------------------- */

/* One Float64; the test fails unless the status is fmi3OK. */
void fmu3_set(fmi3Instance instance, fmi3ValueReference reference, double value);
double fmu3_get(fmi3Instance instance, fmi3ValueReference reference);

fmi3Status fmu3_try_set(fmi3Instance instance, fmi3ValueReference reference, double value);
void fmu3_set_int32(fmi3Instance instance, fmi3ValueReference reference, fmi3Int32 value);
void fmu3_set_method(fmi3Instance instance, int method);
void fmu3_get_states(fmi3Instance instance, double x[FMU_STATES]);

/* ---- Steps ---------------------------------------------------------------------------------- */

struct fmu3_step {
    fmi3Status status;
    bool event, terminate, early;
    double reached; /* s */
};

struct fmu3_step fmu3_try_step(fmi3Instance instance, double time, double step);

/* Fails the test unless the step is done as a whole, with nothing to report. */
void fmu3_step(fmi3Instance instance, double time, double step);

#endif
