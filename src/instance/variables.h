/* The table of variables that fmu/generate.py makes from variables.toml, what follows from a row of
 * it, and the values that belong to the instance. Terms as in section 2.2.7 of the FMI 2.0
 * specification. */
#ifndef VARIABLES_H
#define VARIABLES_H

#include "model.h"
#include "ode.h" // enum integrator_method
#include "platform.h"
#include "status.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>

struct instance;

/* All but float64 are kept as an int: an enumeration as 1 for its first item, a Boolean as 0 or 1.
 */
enum variable_type { VARIABLE_FLOAT64, VARIABLE_INT32, VARIABLE_ENUMERATION, VARIABLE_BOOLEAN };

/* The structure that holds the value: the model's own or struct instance_values. */
enum variable_owner { VARIABLE_OF_MODEL, VARIABLE_OF_INSTANCE };

enum causality {
    CAUSALITY_PARAMETER,
    CAUSALITY_INPUT,
    CAUSALITY_OUTPUT,
    CAUSALITY_LOCAL,
    CAUSALITY_INDEPENDENT,
};

enum variability {
    VARIABILITY_FIXED,
    VARIABILITY_TUNABLE,
    VARIABILITY_DISCRETE,
    VARIABILITY_CONTINUOUS,
};

enum initial { INITIAL_NONE, INITIAL_EXACT, INITIAL_CALCULATED };

struct variable {
    unsigned reference;
    const char *name;
    enum variable_type type;
    enum variable_owner owner;
    size_t offset; /* bytes into the structure of the owner */
    enum causality causality;
    enum variability variability;
    enum initial initial;
    double start;   /* 0: none */
    double min;     /* -INFINITY: none */
    double max;     /* INFINITY: none */
    double nominal; /* > 0 */
};

/* A model and its variables, as declared in variables.toml. */
struct model_description {
    const char *name; /* model name and identifier */
    const char *guid;
    double default_tolerance; /* relative, if neither experiment nor parameter gives one */
    const struct model *model;
    const struct variable *variables;
    size_t variable_count;
    const short *row_of_reference; /* -1: no such reference */
    unsigned reference_count;      /* entries of row_of_reference */
    const unsigned *indicators;    /* references, in the order of the model; NULL: none */
    size_t indicator_count;
    bool has_time_events;
};

/* Phase in the life of an instance; it decides what may be set. */
enum phase {
    PHASE_INSTANTIATED,
    PHASE_INITIALIZATION,
    PHASE_STEPPING,        /* between steps; in Model Exchange: event mode */
    PHASE_CONTINUOUS_TIME, /* Model Exchange: time is integrated from outside */
    PHASE_COUNT,
};

/* Of a reference that is known to exist. */
static inline const struct variable *variable_of(const struct model_description *description,
                                                 unsigned reference) {
    return &description->variables[description->row_of_reference[reference]];
}

/* NULL where no variable has this reference. */
static inline const struct variable *variable_find(const struct model_description *description,
                                                   unsigned reference) {
    if (reference >= description->reference_count || description->row_of_reference[reference] < 0) {
        return NULL;
    }
    return variable_of(description, reference);
}

/* Before and during initialization: start values and inputs; later: inputs and tunable parameters.
 */
static inline bool variable_is_settable(const struct variable *variable, enum phase phase) {
    if (variable->causality == CAUSALITY_INPUT) {
        return phase != PHASE_CONTINUOUS_TIME || variable->variability == VARIABILITY_CONTINUOUS;
    }
    if (phase == PHASE_INSTANTIATED || phase == PHASE_INITIALIZATION) {
        return variable->initial == INITIAL_EXACT;
    }
    return phase == PHASE_STEPPING && variable->causality == CAUSALITY_PARAMETER &&
           variable->variability == VARIABILITY_TUNABLE;
}

/* Says through sink why a value is refused. */
enum status variable_refuse_value(const struct variable *variable, double value,
                                  const struct message_sink *sink);

/* STATUS_OK, or why value is refused: not finite, or outside [min, max]. Inline: it runs for each
 * value that is set. */
static inline enum status variable_check_value(const struct variable *variable, double value,
                                               const struct message_sink *sink) {
    const bool is_allowed = value >= variable->min && value <= variable->max && isfinite(value);
    return is_allowed ? STATUS_OK : variable_refuse_value(variable, value, sink);
}

const char *variable_type_name(enum variable_type type);

/* ---- Values of the instance ----------------------------------------------------------------- */

/* Values of the variables with owner = "instance" (time_variable.toml, solver_variables.toml).
 */
struct instance_values {
    double time;                         /* s */
    int solver_steps;                    /* internal steps since initialization */
    int solver_rhs_evaluations;          /* the integrator's, since initialization */
    double relative_tolerance;           /* 0: that of the experiment */
    int max_internal_steps;              /* per communication step */
    double effective_relative_tolerance; /* what the integrator runs at */
    int solver_restarts;                 /* since initialization */
    double solver_last_step;             /* s: length of the last internal step */
    int solver_last_order;
    int solver_failed_steps; /* refused attempts since initialization */
    int solver_method;       /* an enum integrator_method */
    double max_step;         /* s: of internal steps; 0: no limit */
    int event_count;         /* since initialization */
    double last_event_time;  /* s; that of the start, before there has been one */
    int max_events;          /* per communication step */
};

struct instance_experiment {
    double start_time; /* s */
    bool stop_time_defined;
    double stop_time; /* s; steps past it are refused */
    bool tolerance_defined;
    double tolerance; /* relative, > 0 */
};

#endif
