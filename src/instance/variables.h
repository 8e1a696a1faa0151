/* Table of variables that fmu/generate.py makes from the file of a model, functions of its rows,
 * and the values that belong to the instance. Terms as in section 2.2.7 of the FMI 2.0
 * specification. */
#pragma once

#include "model.h"
#include "ode.h" // enum integrator_method
#include "platform.h"
#include "status.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>

struct instance;

/* Type of a variable. All but float64 are kept as an int: an enumeration as 1 for its first item, a
 * Boolean as 0 or 1. */
enum variable_type { VARIABLE_FLOAT64, VARIABLE_INT32, VARIABLE_ENUMERATION, VARIABLE_BOOLEAN };

/* Structure that holds the value: the model's own or struct instance_values. */
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
    double start;   /* 0 if it has none */
    double min;     /* -INFINITY without limit */
    double max;     /* INFINITY without limit */
    double nominal; /* > 0 */
};

/* A model and its variables, as its file declares them. */
struct model_description {
    const char *name; /* model name and identifier */
    const char *guid;
    double default_tolerance; /* relative tolerance if neither experiment nor parameter gives one */
    const struct model *model;
    const struct variable *variables;
    size_t variable_count;
    const short *row_of_reference; /* row of each reference; -1 if no variable has it */
    unsigned reference_count;      /* number of entries of row_of_reference */
    const unsigned *indicators; /* references, in the order of the model; NULL if there are none */
    size_t indicator_count;
    bool has_time_events;
};

/* Phase in the life of an instance; it decides which variables may be set. */
enum phase {
    PHASE_INSTANTIATED,
    PHASE_INITIALIZATION,
    PHASE_STEPPING,        /* between steps; in Model Exchange: event mode */
    PHASE_CONTINUOUS_TIME, /* Model Exchange: time is integrated from outside */
    PHASE_COUNT,
};

/* Returns the variable with a reference that is known to exist. */
static inline const struct variable *variable_of(const struct model_description *description,
                                                 unsigned reference) {
    return &description->variables[description->row_of_reference[reference]];
}

/* Returns the variable with this reference; NULL if there is none. */
static inline const struct variable *variable_find(const struct model_description *description,
                                                   unsigned reference) {
    if (reference >= description->reference_count || description->row_of_reference[reference] < 0) {
        return NULL;
    }
    return variable_of(description, reference);
}

/* True if the variable may be set: before and during initialization start values and inputs; later
 * inputs and tunable parameters. */
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

/* True if only events write the variable once the initialization has ended. */
static inline bool variable_is_discrete_state(const struct variable *variable) {
    return variable->owner == VARIABLE_OF_MODEL && variable->variability == VARIABILITY_DISCRETE &&
           variable->causality != CAUSALITY_INPUT;
}

/* Sends a message that says why a value is refused, and returns the status. */
enum status variable_refuse_value(const struct variable *variable, double value,
                                  const struct message_sink *sink);

/* Returns STATUS_OK, or refuses a value that is not finite or outside [min, max]. Inline: it runs
 * for each value that is set. */
static inline enum status variable_check_value(const struct variable *variable, double value,
                                               const struct message_sink *sink) {
    const bool is_allowed = value >= variable->min && value <= variable->max && isfinite(value);
    return is_allowed ? STATUS_OK : variable_refuse_value(variable, value, sink);
}

const char *variable_type_name(enum variable_type type);

/* ---- Values of the instance ----------------------------------------------------------------- */

/* Values of the variables that models have without declaring them: the time, and those of
 * *_variables.toml, by their names. */
struct instance_values {
    double relative_tolerance;           /* 0 for the tolerance of the experiment */
    double effective_relative_tolerance; /* relative tolerance at which the integrator runs */
    int solver_method;                   /* an enum integrator_method */
    int max_events;                      /* per communication step */
    double max_step;                     /* longest internal step, s; 0 without limit */
    double last_event_time;              /* s; the start time before the first event */
    int event_count;                     /* since initialization */

    /* each step reads or writes these */
    double time;                /* s */
    int solver_steps;           /* internal steps since initialization */
    int solver_rhs_evaluations; /* evaluations of the integrator since initialization */
    int solver_restarts;        /* since initialization */
    int solver_last_order;
    double solver_last_step; /* length of the last internal step, s */
    int solver_failed_steps; /* refused attempts since initialization */
    int max_internal_steps;  /* per communication step */
};

struct instance_experiment {
    double start_time; /* s */
    bool stop_time_defined;
    double stop_time; /* s; steps past it are refused */
    bool tolerance_defined;
    double tolerance; /* relative, > 0 */
};
