/* Structure of an instance: its parts, the places of its values, and the values of the integrator.
 * Private to this library. */
#pragma once

#include "clock.h"
#include "integrator.h"
#include "variables.h"

#include <stddef.h>
#include <string.h>

/* Bounds of the integrator's relative tolerance: below, rounding stops its error test from
 * converging; above, results have no digit left. */
#define INSTANCE_FINEST_TOLERANCE   1e-14
#define INSTANCE_COARSEST_TOLERANCE 1e-2

/* Largest tolerance that is taken from the experiment: masters pass their own, made for coarser
 * models (Maestro's is 0.1), and results would lose their digits. */
#define INSTANCE_COARSEST_EXPERIMENT_TOLERANCE 1e-4

/* Whether a step has ended at an event and the instance is still there. */
enum event_point {
    NO_EVENT,
    EVENT_UNHANDLED, /* the modes have not been updated yet */
    EVENT_HANDLED,   /* the modes have been updated */
};

/* State of an instance: with the values in struct instance_memory, all that later results depend
 * on. A snapshot is a copy of both. */
struct instance_state {
    struct instance_experiment experiment;
    struct instance_values own;
    enum phase phase;
    bool experiment_defined;
    struct clock_time time; /* a step writes all fields from here on, and few before */
    double drift;           /* sum of clock_step_drift over all steps, s */

    /* The integrator's history, from which it continues while nothing changes. A replay needs only
     * the restart and the first and the last advance since then (integrator_advance). Only
     * history.c and stepping.c update these fields. */
    bool has_history;
    struct clock_time restart_time;
    double horizon;     /* time that the integrator may not pass, s since the restart */
    double first_time;  /* s since the restart */
    double latest_time; /* s since the restart */
    double passed_time; /* end of the last internal step, s since the restart */
    struct integrator_statistics statistics;
    int64_t steps_before_restart; /* internal steps before the restart */
    double restart_step; /* first internal step of the last restart, s; 0 if the method found it */
    double next_step;    /* first internal step of a restart now, s; 0 if the method finds it */
    bool restart_continues;   /* true if the last restart continued the solution before it */
    bool restart_after_event; /* true if it did so after an event */

    enum event_point event_point;
    struct clock_time cut_end; /* end of the step without that event */
};

/* Parts of one block of memory; a snapshot copies the block. In it the inputs stand first, in this
 * order, then largest_inputs, unhandled, restart_values and values. Here what each step reads
 * stands last. */
struct instance_memory {
    double *largest_inputs; /* largest magnitude of each so far; empty without `errors` */
    bool *unhandled;        /* causes of the unhandled event, like triggered of struct instance */
    char *block;
    size_t size;                     /* bytes */
    struct range written_at_restart; /* part of the block that a step writes besides: active_inputs
                                        to restart_values */

    struct polynomial *next_inputs; /* inputs of the next step: last value set, and derivatives */
    struct polynomial *current_inputs; /* inputs at the current time */
    struct polynomial *active_inputs;  /* inputs since the last restart */
    char *restart_values; /* value structure at the last restart, with which the integrator runs */
    char *values; /* value structure of the model, as set and read from outside, with the inputs at
                     the current time */
    struct range written; /* part of a value structure that a step writes, besides calculated values
                           */
};

/* Place and kind of the value of a reference. */
struct instance_real {
    const double *value; /* NULL if it is no float64 */
    bool is_calculated; /* true if the model's outputs calculate it: it has to be brought up to date
                         */
    bool is_kept;       /* true if events keep it: in initialization mode it is calculated, too */
};

/* The fields that each step reads or writes stand together, last: if many instances are stepped in
 * turn, few lines of a cache are used for each. */
struct instance {
    struct message_sink sink;
    struct ode ode;
    double *absolute_tolerances; /* one per state, as the integrator has them; NULL if the model has
                                    no events */
    double *event_tolerances;    /* one per state, at its value at the last event */
    struct indicator *indicators; /* one per indicator, since the last restart */
    double *du;                   /* derivative of each input by the time */
    double *z;                    /* three per indicator */
    bool *triggered; /* one per indicator: true if it falls to 0; the last: true at a time event */
    double *nodes;   /* POLYNOMIAL_NODES values per input, of the step that asks for them */
    char *first_derivatives; /* value structures, along a curve (struct model) */
    char *second_derivatives;
    char *initial_values; /* value structure, see values.c; NULL if it would be memory.values */
    struct instance_snapshot *newest; /* list of the snapshots that belong to the instance */
    struct instance_snapshot *oldest;
    struct instance_memory memory;

    const struct model_description *description;
    const struct model *model;
    struct instance_state state;

    struct instance_real *reals; /* by value reference */

    bool is_integrated_outside;
    bool states_are_settable;   /* true if states may be set in event mode, too */
    bool step_met_event;        /* true if the last step met an event */
    bool outputs_are_valid;     /* true if the calculated values belong to the others */
    bool parameters_are_valid;  /* true if they are consistent, false if not known */
    bool parameters_are_active; /* true if instance_parameters_are_active, false if not known */
    bool indicators_are_active; /* true if no update has been since the integrator was restarted
                                   with the indicators, false if not known */
    bool history_is_lost;       /* true if the integrator is not where state says: replay first */
    bool inputs_are_held;       /* true if the inputs of the next step are constant and equal to
                                   current_inputs, false if not known */
    bool inputs_move; /* true if inputs move since the last restart; if not, u has their values */
    double *u;        /* one value per input, as the right-hand side sees them */
    double (*input_series)[SERIES_INPUT_LENGTH]; /* coefficients of each input */
    bool has_avx2;                               /* the processor has it, and the series asks */
    struct integrator *integrator;               /* NULL without states and indicators */
    struct integrator_settings
        configured; /* last settings of the integrator, without the tolerances of the states */
};

/* A saved instance: snapshot.h. */
struct instance_snapshot {
    struct instance_snapshot *newer;
    struct instance_snapshot *older;
    unsigned tag;
    bool history_is_lost; /* of instance_keep, like the next field */
    bool inputs_are_held;
    struct instance_state state;
    max_align_t memory[]; /* copy of instance_memory.block */
};

static inline size_t count_of(struct range range) {
    return range.size / sizeof(double);
}

/* True if the instance integrates the states of its model itself. */
static inline bool instance_has_integrator(const struct instance *instance) {
    return instance->model->states.size > 0 && !instance->is_integrated_outside;
}

/* Returns the largest magnitude (s) among the start time and t: times are rounded like numbers of
 * this size. */
static inline double instance_size_of_times(const struct instance *instance, double t) {
    return clock_larger(fabs(t), fabs(instance->state.experiment.start_time));
}

/* Returns the doubles at a range of a value structure. */
static inline double *doubles_of(char *values, struct range range) {
    return (double *)(void *)(values + range.offset);
}

/* Returns the model's events; no indicators and empty ranges if it has none. */
static inline struct model_events events_of(const struct model *model) {
    return model->events != NULL ? *model->events : (struct model_events){0};
}

/* Returns the time of the next time event, s; INFINITY if there is none. */
static inline double instance_next_time(const struct instance *instance) {
    const struct model_events *events = instance->model->events;
    return events != NULL && events->next_time != NULL ? events->next_time(instance->memory.values)
                                                       : INFINITY;
}

/* True if an event has ended the simulation; its name and reason go to text (size bytes). */
static inline bool instance_explain_end(const struct instance *instance, char *text, size_t size) {
    const struct model_events *events = instance->model->events;
    return events != NULL && events->has_ended != NULL &&
           events->has_ended(instance->memory.values, instance->state.time.s, text, size);
}

/* Lets the searches for solutions of equations begin at those of the present values; where present
 * modes have none, at those in other modes. A search that begins there finds the same bits. */
NONNULL void instance_move_anchors(struct instance *instance);

/* Returns the number of largest_inputs. */
static inline size_t instance_noted_inputs(const struct model *model) {
    return events_of(model).errors != NULL ? count_of(model->inputs) : 0;
}

/* Returns the bytes of the array triggered of struct instance. */
static inline size_t instance_event_size(const struct model *model) {
    return model->events != NULL ? (model->events->indicator_count + 1) * sizeof(bool) : 0;
}

/* ---- Values that the integrator runs with --------------------------------------------------- */

/* True if the inputs of the next step are constant and equal to the active ones. Polynomials need
 * no comparison: the integrator's horizon ends with their step. */
static inline bool instance_inputs_are_active(const struct instance *instance) {
    const struct instance_memory *memory = &instance->memory;
    const size_t count = count_of(instance->model->inputs);
    for (size_t i = 0; i < count; i++) {
        const struct polynomial *next = &memory->next_inputs[i];
        if (next->d[0] != memory->active_inputs[i].d[0] ||
            (!instance->inputs_are_held && polynomial_moves(next))) {
            return false;
        }
    }
    return true;
}

static inline bool instance_range_is_active(const struct instance *instance, struct range range) {
    const struct instance_memory *memory = &instance->memory;
    return memcmp(memory->restart_values + range.offset, memory->values + range.offset,
                  range.size) == 0;
}

/* True if the parameters and Boolean inputs are equal to the active ones. */
static inline bool instance_parameters_are_active(const struct instance *instance) {
    const struct model_events *events = instance->model->events;
    return instance->parameters_are_active ||
           (instance_range_is_active(instance, instance->model->parameters) &&
            (events == NULL || instance_range_is_active(instance, events->discrete_inputs)));
}

static inline bool instance_values_are_active(const struct instance *instance) {
    return instance_inputs_are_active(instance) && instance_parameters_are_active(instance);
}

/* ---- Places of values ----------------------------------------------------------------------- */

/* Sends a message that says why there is no variable with this reference and type. Returns NULL. */
NONNULL const struct variable *instance_refuse_reference(const struct instance *instance,
                                                         unsigned reference,
                                                         enum variable_type type);

/* Returns the place of a variable's value. */
static inline void *instance_field(struct instance *instance, const struct variable *variable) {
    char *structure = variable->owner == VARIABLE_OF_MODEL ? instance->memory.values
                                                           : (char *)(void *)&instance->state.own;
    return structure + variable->offset;
}

static inline bool instance_is_state(const struct instance *instance,
                                     const struct variable *variable) {
    return variable->owner == VARIABLE_OF_MODEL &&
           variable->offset - instance->model->states.offset < instance->model->states.size;
}

/* True if the variable is a double that events write and that has a start value. */
static inline bool instance_is_kept_number(const struct instance *instance,
                                           const struct variable *variable) {
    const struct model_events *events = instance->model->events;
    return variable_is_discrete_state(variable) && variable->type == VARIABLE_FLOAT64 &&
           events != NULL &&
           variable->offset - events->discrete_states.offset < events->discrete_states.size &&
           (variable->initial == INITIAL_EXACT || events->starts_follow);
}

/* Returns the index of an input of type float64 among the inputs. */
static inline size_t instance_input_index(const struct instance *instance,
                                          const struct variable *variable) {
    return (variable->offset - instance->model->inputs.offset) / sizeof(double);
}

/* Writes the value; inline, because it runs for each value that is set. The value of an input of
 * type float64 also goes into its polynomial of the next step. */
static inline void instance_write_field(struct instance *instance, const struct variable *variable,
                                        double value) {
    void *field = instance_field(instance, variable);
    if (variable->causality == CAUSALITY_INPUT && variable->type == VARIABLE_FLOAT64) {
        const size_t i = instance_input_index(instance, variable);
        struct polynomial next = instance->memory.next_inputs[i];
        next.d[0] = value; // a copy of memory that was just written would wait
        instance->memory.next_inputs[i] = next;
        instance->memory.current_inputs[i] = next;
        *(double *)field = value;
        return;
    }
    instance->parameters_are_active = false;
    instance->parameters_are_valid &= variable->causality != CAUSALITY_PARAMETER;
    if (variable->type == VARIABLE_FLOAT64) {
        *(double *)field = value;
    } else {
        *(int *)field = (int)value;
    }
}

/* Returns the value structure with the calculated values, once they are up to date. In
 * initialization mode these are the values after the end of this mode. */
static inline char *instance_shown_values(const struct instance *instance) {
    const bool is_initializing = instance->state.phase == PHASE_INITIALIZATION;
    return is_initializing && instance->initial_values != NULL ? instance->initial_values
                                                               : instance->memory.values;
}

static inline void instance_set_clock(struct instance *instance, struct clock_time time) {
    instance->state.time = time;
    instance->state.own.time = time.s;
    instance->outputs_are_valid = false;
}

/* Returns STATUS_NOT_FINITE, with a message that `what` cannot be computed. */
NONNULL enum status instance_not_finite(const struct instance *instance, const char *what);

/* ---- Settings -------------------------------------------------------------------------------
 * Experiment, parameters, and the integrator's settings that follow. */

/* Ratio of a state's absolute tolerance to the relative tolerance times the nominal value. */
#define INSTANCE_ABSOLUTE_FRACTION 1e-2

/* Returns STATUS_OK if the experiment can be run; otherwise a message says why not. */
MUST_CHECK NONNULL enum status
instance_check_experiment(const struct instance *instance,
                          const struct instance_experiment *experiment);

/* Returns STATUS_OK if the parameters are consistent; otherwise a message says why not. */
MUST_CHECK NONNULL enum status instance_check_parameters(struct instance *instance);

/* Return the requested relative tolerance, and the one of the integrator, by settings in state. */
NONNULL double instance_requested_tolerance(const struct instance *instance,
                                            const struct instance_state *state);
NONNULL double instance_tolerance(const struct instance *instance,
                                  const struct instance_state *state);

/* Writes this tolerance where users read it, and the absolute tolerances. */
NONNULL void instance_update_tolerance(struct instance *instance);

/* True if the values ask for another method, tolerance or limit than the integrator has. */
NONNULL bool instance_is_configured_otherwise(const struct instance *instance);

/* Gives the integrator the method, tolerances and limits that the values ask for. */
MUST_CHECK NONNULL enum status instance_configure_integrator(struct instance *instance);
