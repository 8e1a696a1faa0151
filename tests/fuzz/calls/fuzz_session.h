/* The instances, FMU states and serialized states that the calls of one input work on, mixed up as
 * the input says. */
#ifndef FUZZ_SESSION_H
#define FUZZ_SESSION_H

#include "fmu3_library.h"
#include "fuzz_instance.h"
#include "value_references.h"

enum { FUZZ_INSTANCES = 3, FUZZ_STATES = 5, FUZZ_SERIALIZED = 3 };

struct fuzz_session {
    struct fuzz_input *input;
    struct fuzz_instance *instances[FUZZ_INSTANCES]; /* NULL: not made yet, or freed */
    struct fuzz_state {
        fmi2FMUstate handle;         /* NULL: none */
        struct fuzz_instance *owner; /* the instance that made it */
        bool in_error;               /* and what was known of it then */
        double time;                 /* s */
    } states[FUZZ_STATES];
    struct fuzz_serialized {
        fmi2Byte *bytes; /* NULL: none */
        size_t size;
        fmi2Type kind;
        unsigned variety;
        bool in_error;
        double time; /* s */
    } serialized[FUZZ_SERIALIZED];
};

/* The instance that the input says; made if it does not exist yet. */
struct fuzz_instance *fuzz_session_instance(struct fuzz_session *session);

/* Frees the instance, and with it the states that it made. */
void fuzz_session_free_instance(struct fuzz_session *session, struct fuzz_instance *instance);

void fuzz_session_end(struct fuzz_session *session);

/* One call of each function, with arguments that the input says, and what holds for it:
 * of values in fuzz_access.c, of modes in fuzz_modes.c, of states in fuzz_session.c. Those of one
 * version only are in its target: fuzz_calls.c, fuzz_calls_fmi3.c. */
typedef void fuzz_operation(struct fuzz_session *session, struct fuzz_instance *instance);
#define FUZZ_OPERATION(name, kinds, states) fuzz_operation fuzz_call_##name;
FMI2_FUNCTION_LIST(FUZZ_OPERATION)
#undef FUZZ_OPERATION

/* Those of FMI 3.0: fuzz_access_fmi3.c, fuzz_calls_fmi3.c. */
#define FUZZ3_OPERATION(name, kinds, states) fuzz_operation fuzz3_call_##name;
FMI3_FUNCTION_LIST(FUZZ3_OPERATION)
#undef FUZZ3_OPERATION

/* A run of a target: these calls, and sequences of calls that lead further. */
void fuzz_session_run(struct fuzz_input *input, fuzz_operation *const calls[], size_t count);

#endif
