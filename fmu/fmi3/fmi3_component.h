/* What an fmi3Instance points to, and what the files of this adapter share. */
#ifndef FMI3_COMPONENT_H
#define FMI3_COMPONENT_H

#include "component.h"
#include "fmi3_calls.h"
#include "stepping.h"

#include "fmi3Functions.h"

#include <stdint.h>

struct fmi3_component {
    struct component base;         /* first */
    fmi3LogMessageCallback logger; /* NULL: no log */
    fmi3InstanceEnvironment environment;

    /* Co-Simulation */
    fmi3IntermediateUpdateCallback update; /* NULL: no intermediate updates */
    bool early_return_allowed;
    bool asks_inputs;            /* inputs are among the variables of intermediate updates */
    bool can_set;                /* in intermediate update mode: inputs */
    bool can_get;                /* in intermediate update mode */
    struct step_options options; /* of every step */
    bool is_intermediate[];      /* by row of the table of variables: it was named for intermediate
                                    updates */
};

_Static_assert((int)COMPONENT_OK == fmi3OK && (int)COMPONENT_WARNING == fmi3Warning &&
                   (int)COMPONENT_DISCARD == fmi3Discard && (int)COMPONENT_ERROR == fmi3Error &&
                   (int)COMPONENT_FATAL == fmi3Fatal,
               "a component_status is converted by a cast");
_Static_assert(sizeof(int) == sizeof(fmi3Int32), "an fmi3Int32 is an int");

static inline fmi3Status fmi3_status(enum component_status status) {
    return (fmi3Status)status;
}

/* A call of the table that this FMU does not support: an error that says why. */
fmi3Status fmi3_unsupported(fmi3Instance instance, enum fmi3_call call, const char *reason);

/* Whether the number of values is the one expected; if not, fails as component_fail. */
bool fmi3_has_count(struct component *component, enum fmi3_call call, size_t count,
                    size_t expected);

/* Whether the variables may be read or set in intermediate update mode; if not, fails as
 * component_fail. Other modes are not checked here. */
bool fmi3_may_access(struct component *component, unsigned call, bool setting,
                     const fmi3ValueReference references[], size_t count);

/* Prepares steps with these settings. Allocates what undoing a step needs, since steps allocate
 * nothing. */
MUST_CHECK enum status fmi3_prepare_steps(struct fmi3_component *component);

#endif
