/* Events of models that are made from their equations (fmu/compiler): struct model_events of any
 * such model.
 *
 * A relation compares two values; its mode says whether it holds, and changes at events only. An
 * event of the model fires when its condition becomes true. A sampler ticks at the times start +
 * (offset + k every), k = 0, 1, ...; with a period of 0 it never does. */
#pragma once

#include "contacts.h"
#include "gradients.h"
#include "model.h"

#include <float.h>
#include <limits.h>
#include <math.h>

/* Constant properties of a relation. */
struct relation {
    bool includes_zero; /* true if it holds at its limit */
    bool is_timed;      /* true if its time is known in advance */
    bool rises;         /* of a timed relation: true if it holds after its time */
    bool is_of_inputs;  /* true if inputs move it and nothing else, also by way of others */
    bool is_of_time;    /* true if, between events, it moves by the time only */
    size_t indicator;   /* of a relation that is not timed */
};

/* The segment of a table in which a value is, or the whole number up to a value, and the relations
 * of the value with its ends. It changes at events only. */
struct segment {
    int low;           /* relation that holds from the segment's begin on */
    int high;          /* relation that holds from its end on */
    int first, last;   /* numbers of the table's segments */
    bool is_of_inputs; /* true if inputs move the value and nothing else */
};

/* A mode of the model, or a discrete variable that is a whole number. */
struct count {
    const char *name;
    int first, last; /* smallest and largest value */
};

struct compared {
    double distance; /* above 0 where the relation holds */
    double slope;    /* 1/s: derivative of the distance by the time */
    double noise;    /* bound of the distance's error, by errors of values and rounding */
    int used;        /* 1 if a value that is needed reads it */
};

/* An expression that an event or a sampler of the file assigns to a state or discrete variable. */
struct assignment {
    int event;        /* as of `change`; -1: the start */
    size_t offset;    /* of the variable */
    const char *text; /* "name = expression" */
};

/* Errors of the values that distances depend on, and motion of the inputs. */
struct given {
    const double *state_errors; /* of each state, in its unit */
    double time;                /* error of the time, s */
    double inputs;              /* relative error of all inputs */
    const double *largest;      /* of each input so far: its error is relative to it, too */
    const double *du;           /* derivative of each input by the time */
    bool is_free; /* true if solutions are searched in the modes that follow from them */
};

/* Numbers, in the place of an event's, of the start values and of the conditions of all events. */
enum { RELATIONS_START = -1, RELATIONS_CONDITIONS = -2 };

struct relations {
    size_t values_size;
    /* int[]: 1 if initialization has ended; the mode of each relation; 1 per event that is due;
     * number from 1 of the event that has ended the simulation, or 0; the number of each segment;
     * counts of the model */
    struct range modes;
    size_t states; /* offset of the states */
    /* double[], discrete states of the model: with samplers first the start time, s, and the number
     * of ticks of each sampler; then its discrete variables */
    struct range discrete;
    int relation_count, event_count, sampler_count, segment_count, count_count, state_count;
    bool has_inputs; /* true if some relation depends on inputs and parameters only */
    const struct relation *relation;
    const struct segment *segment;
    const struct count *count;
    const double *nominal;    /* of each state */
    const bool *is_circular;  /* of each relation: its distance follows from its own mode.
                                 NULL if there is none */
    const char *const *names; /* of relations; NULL if none is circular */
    const bool *ends;         /* of each event: true if it ends the simulation. NULL if none does */
    const char *const *change_names; /* of events, then of samplers */
    const char *const *every_names;  /* of the period of each sampler */
    const struct assignment *assignment;
    int assignment_count;
    const struct contacts *contacts;   /* NULL: none */
    const struct gradients *gradients; /* NULL: none */

    /* False if parameters switch off all that reads relations. NULL if they cannot. */
    bool (*are_read)(const void *values);

    /* Writes the start values of modes, and of states and discrete variables that follow from
     * parameters. NULL if there are none. */
    void (*start)(void *values);
    void (*compare)(const void *values, double t, const struct given *given,
                    struct compared compared[]);
    /* Writes the time of each timed relation, s. */
    void (*write_times)(const void *values, double times[]);
    /* Writes every and offset of each sampler, s. */
    void (*write_periods)(const void *values, double every[], double offset[]);
    /* Writes in which segment of its table each value is. */
    void (*locate)(const void *values, double t, int segment[]);
    void (*find_due)(const void *values, double t, int due[]);
    /* Performs an event or, with event_count added to its number, a sampler: right sides use the
     * values before it; a state that jumps gets the tolerance of its right side. later: time at
     * which right sides see what switches by the time, s. du: derivative of each input by the time;
     * shift: of the time of the event by each parameter of gradients. */
    void (*change)(void *values, double t, double later, int event, const double du[],
                   const double shift[], double tolerance[]);
    /* Returns "NAME = expression" of a condition or whole number that has no value: of what
     * `change` would assign, or of RELATIONS_START, RELATIONS_CONDITIONS; NULL if all have one.
     * NULL if none can miss it. */
    const char *(*undefined)(const void *values, double t, double later, int event);
};

/* Memory for one call. */
struct relations_room {
    struct compared *compared; /* one per relation and two per contact */
    struct compared *before;   /* one per relation */
    double *times;             /* one per relation */
    double *every, *offset;    /* one per sampler */
    int *segment;              /* one per segment */
    int *due;                  /* one per event */
    int *turned;               /* one per relation; zeros */
    double *tolerance;         /* one per state */
    double *assigned;          /* one per assignment */
    int *counted;              /* one per count */
    const double *zeros;       /* one per state and input */
    struct contacts_room contacts;
    struct gradients_room gradients;
};

static inline const int *relations_modes(const struct relations *model, const void *values) {
    return (const int *)(const void *)((const char *)values + model->modes.offset);
}

static inline const double *relations_discrete(const struct relations *model, const void *values) {
    return (const double *)(const void *)((const char *)values + model->discrete.offset);
}

/* Returns the time of a sampler's next tick, s: never a sum of periods, which would drift. INFINITY
 * with a period of 0. room has the periods. */
double relations_tick_time(const struct relations *model, struct relations_room room,
                           const void *values, int sampler);

/* Functions of struct model_events. */
double relations_next_time(const struct relations *model, struct relations_room room,
                           const void *values);
bool relations_are_plausible(const struct relations *model, const void *values);
enum status relations_update(const struct relations *model, struct relations_room room,
                             void *values, const struct event *event);

/* errors of struct model_events. */
void relations_errors(const struct relations *model, struct relations_room room, const void *values,
                      double t, const double state_errors[], const double largest_inputs[],
                      double relative, double errors[]);

/* True if all values are finite: 0 x is 0 for finite values only. */
static inline bool relations_are_finite(const double value[], size_t count) {
    double sum = 0.0;
    for (size_t i = 0; i < count; i++) {
        sum += 0.0 * value[i];
    }
    return sum == 0.0;
}

/* Returns the last segment that begins at or below x, from the rising begins of all segments; the
 * first one if none does. */
static inline int relations_locate(const double begins[], size_t count, double x) {
    size_t low = 0;
    size_t high = count;
    while (high - low > 1) {
        const size_t middle = low + (high - low) / 2;
        *(x >= begins[middle] ? &low : &high) = middle;
    }
    return (int)low;
}

enum { RELATIONS_MOST_COUNTED = 1 << 30 };

/* Returns a whole number; MODEL_NO_INT if an int cannot hold it. */
static inline int relations_whole(double x) {
    return fabs(x) <= INT_MAX ? (int)x : MODEL_NO_INT;
}

/* Returns the largest whole number up to x, within +-RELATIONS_MOST_COUNTED. */
static inline int relations_floor(double x) {
    return (int)floor(fmax(-RELATIONS_MOST_COUNTED, fmin(x, RELATIONS_MOST_COUNTED)));
}

/* Returns the element at a place, a whole number from 0 on; NAN if there is none. */
static inline double relations_element(const double elements[], int count, double place) {
    return place >= 0.0 && place < count ? elements[(int)place] : (double)NAN;
}

/* The same of an array of whole numbers. */
static inline double relations_count(const int elements[], int count, double place) {
    return place >= 0.0 && place < count ? elements[(int)place] : (double)NAN;
}

/* Error of the time of a time event, over its size. */
#define RELATIONS_TIME_ROUNDING (16.0 * DBL_EPSILON)

/* Returns a time at which what switches at t (s), which may be wrong by `error` (s), has switched.
 */
static inline double relations_later(double t, double error) {
    return t + fmax(error, DBL_MIN);
}

/* Returns a bound of the error of y, a function of an argument with an error, from y's values at
 * both ends of the argument's range. A value that is not defined does not count. */
static inline double relations_spread(double y, double at_begin, double at_end) {
    return fmax(fabs(at_begin - y), fabs(at_end - y));
}

/* Returns the values with modes that have followed all inputs and parameters set since the last
 * event: `values` itself, or `copy`. */
const void *relations_followed(const struct relations *model, struct relations_room room,
                               const void *values, double t, void *copy);

/* Returns the indicator of a relation whose distance is offset + factor x[state]: the distance if
 * the relation holds, otherwise its negative, so that it falls to 0 where the mode changes. rate:
 * derivative of the state by the time; 0 if unknown. */
static inline struct indicator relations_state_indicator(size_t state, int holds, double factor,
                                                         double offset, double rate) {
    const double sign = holds ? 1.0 : -1.0;
    return (struct indicator){.kind = INDICATOR_OF_STATE,
                              .state = state,
                              .factor = sign * factor,
                              .offset = sign * offset,
                              .rises = sign * factor * rate > 0.0};
}

/* Returns the indicator that the model writes: a distance from a limit. */
static inline struct indicator relations_model_indicator(double limit) {
    return (struct indicator){.kind = INDICATOR_OF_MODEL, .offset = fabs(limit)};
}

/* Returns the indicator of a force that holds a direction, a distance from what friction can. */
static inline struct indicator relations_force_indicator(double limit) {
    return (struct indicator){
        .kind = INDICATOR_OF_MODEL, .offset = fabs(limit), .is_far_above = 0.25 * fabs(limit)};
}
