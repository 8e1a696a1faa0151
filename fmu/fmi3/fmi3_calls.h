/* The structure that an fmi3Instance points to, and checks of the calls of FMI 3.0. */
#pragma once

#include "fmi3Functions.h"
#include "fmi3_functions.h"
#include "fmi_instance.h"
#include "stepping.h"

#include <stdint.h>

#define FMI3_CALL_CODE(name, kinds, states) CALL_fmi3##name,
enum fmi3_call { FMI3_FUNCTION_LIST(FMI3_CALL_CODE) FMI3_CALL_COUNT };
#undef FMI3_CALL_CODE

extern const struct call_rule fmi3_call_rules[FMI3_CALL_COUNT];

/* ---- Component ------------------------------------------------------------------------------ */

struct fmi3_instance {
    struct fmi_instance base;      /* first */
    fmi3LogMessageCallback logger; /* NULL for no log */
    fmi3InstanceEnvironment environment;

    /* Co-Simulation */
    fmi3IntermediateUpdateCallback update; /* NULL for no intermediate updates */
    bool early_return_allowed;
    bool asks_inputs; /* true if inputs are among the variables of intermediate updates */
    bool can_set;     /* true if inputs may be set in intermediate update mode */
    bool can_get;     /* true if values may be read in intermediate update mode */
    struct step_options options; /* options of every step */
    bool is_intermediate[];      /* by row of the table of variables: true if it was named for
                                    intermediate updates */
};

_Static_assert((int)FMI_OK == fmi3OK && (int)FMI_WARNING == fmi3Warning &&
                   (int)FMI_DISCARD == fmi3Discard && (int)FMI_ERROR == fmi3Error &&
                   (int)FMI_FATAL == fmi3Fatal,
               "a fmi_status is converted by a cast");
_Static_assert(sizeof(int) == sizeof(fmi3Int32), "an fmi3Int32 is an int");

static inline fmi3Status fmi3_status(enum fmi_status status) {
    return (fmi3Status)status;
}

/* Returns true if the number of values is right; otherwise fails as fmi_fail. */
bool fmi3_check_count(struct fmi_instance *fmi, enum fmi3_call call, size_t count, size_t expected);

/* Returns true if the variables may be read or set in intermediate update mode; otherwise fails as
 * fmi_fail. Other modes are not checked here. */
NONNULL_ARGUMENTS(1)
bool fmi3_check_access(struct fmi_instance *fmi, enum fmi3_call call, bool setting,
                       const fmi3ValueReference references[], size_t count);
