/* Shared by the tests that call the functions of FMI 3.0 themselves: an importer with its
 * callbacks, and instances of the built FMU. */
#ifndef FMU3_HARNESS_H
#define FMU3_HARNESS_H

#include "fmu3_library.h"
#include "value_references.h"

#define FMU3_COUNT(array) (sizeof(array) / sizeof(array)[0])

extern struct fmu3_functions fmu3;

/* Loads the FMU of this build; ends the program where it cannot be used. */
void fmu3_load(void);

/* ---- An importer ---------------------------------------------------------------------------- */

/* What an intermediate update says. */
struct fmu3_update {
    double time;
    bool set, get, finished, can_return_early;
    bool *return_early;
    double *early_time;
};

/* Passed to the FMU as the instance environment. */
struct fmu3_importer {
    unsigned count[fmi3Fatal + 1]; /* messages by status */
    char texts[16384];             /* all messages, one a line, as far as they fit */
    char category[32];             /* of the last message */
    unsigned malformed;            /* NULL or empty strings, a '%', a '#' that is not doubled */

    /* Called in intermediate updates; NULL: they are only counted. */
    void (*update)(struct fmu3_importer *importer, const struct fmu3_update *update);
    unsigned updates;
    fmi3Instance instance; /* the last one made */
    void *data;            /* of update */
};

/* Of the running test. */
extern struct fmu3_importer importer;

void fmu3_clear_messages(struct fmu3_importer *of);
unsigned fmu3_message_count(const struct fmu3_importer *of);

/* The status of a call; the messages are shown where it is another one. */
#define ASSERT_OK(call)      TEST_ASSERT_EQUAL_INT_MESSAGE(fmi3OK, call, importer.texts)
#define ASSERT_DISCARD(call) TEST_ASSERT_EQUAL_INT_MESSAGE(fmi3Discard, call, importer.texts)
#define ASSERT_ERROR(call)   TEST_ASSERT_EQUAL_INT_MESSAGE(fmi3Error, call, importer.texts)

/* Fails the test unless one message contains text. */
void fmu3_assert_logged(const struct fmu3_importer *of, const char *text);

/* ---- Instances ------------------------------------------------------------------------------ */

struct fmu3_options {
    bool event_mode, early_return, intermediate_updates, logging_on;
    const fmi3ValueReference *required; /* variables of intermediate updates */
    size_t required_count;
};

/* What fmi3InstantiateCoSimulation returns, for this importer. */
fmi3Instance fmu3_try_co_simulation(struct fmu3_importer *for_importer,
                                    const struct fmu3_options *options);

/* Instances that fmu3_tear_down frees where the test did not. Options NULL: none. */
fmi3Instance fmu3_co_simulation(struct fmu3_importer *for_importer,
                                const struct fmu3_options *options);
fmi3Instance fmu3_model_exchange(struct fmu3_importer *for_importer);
void fmu3_free(fmi3Instance instance);

/* Frees what is open and fails the test if a message was malformed. */
void fmu3_tear_down(void);

/* Through initialization mode, from start (s); no tolerance and no stop time. */
void fmu3_initialize(fmi3Instance instance, double start);

/* ---- Values --------------------------------------------------------------------------------- */

/* One Float64; the test fails unless the status is fmi3OK. */
void fmu3_set(fmi3Instance instance, fmi3ValueReference reference, double value);
double fmu3_get(fmi3Instance instance, fmi3ValueReference reference);

fmi3Status fmu3_try_set(fmi3Instance instance, fmi3ValueReference reference, double value);
void fmu3_set_int32(fmi3Instance instance, fmi3ValueReference reference, fmi3Int32 value);
void fmu3_set_method(fmi3Instance instance, int method);

/* The four states, in the order of their references. */
enum { FMU3_STATES = 4 };
extern const fmi3ValueReference fmu3_states[FMU3_STATES];
void fmu3_get_states(fmi3Instance instance, double x[FMU3_STATES]);

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
