/* Events of a model that is made from its equations (fmu/equations): struct model_events of any
 * such model.
 *
 * A relation compares two values; its mode says whether it holds, and changes at events only. An
 * event of the model fires when its condition comes to hold. */
#ifndef RELATIONS_H
#define RELATIONS_H

#include "model.h"

#include <math.h>

/* Of a relation what does not change. */
struct relation {
    bool includes_zero; /* it holds at its limit */
    bool is_timed;      /* its time is known before */
    bool rises;         /* of a timed one: it holds after its time */
    bool is_of_inputs;  /* it follows from inputs and parameters only */
    size_t indicator;   /* of one that is not timed */
};

struct compared {
    double distance; /* above 0 where it holds */
    double slope;    /* 1/s: derivative of the distance by the time */
    double noise;    /* how far the distance may be wrong, by errors and rounding */
    int used;        /* by a value that is needed */
};

/* Errors of the values that distances follow from, and how inputs move. */
struct given {
    const double *state_errors; /* of each state, in its unit */
    double time;                /* relative error of the time */
    double inputs;              /* and of all inputs */
    const double *du;           /* derivative of each input by the time */
};

struct relations {
    size_t values_size;
    /* int[]: whether initialization has ended; the mode of each relation; whether each event is
     * due; further modes of the model */
    struct range modes;
    size_t states; /* offset of the states */
    int relation_count, event_count, state_count, input_count;
    bool has_inputs; /* some relation follows from inputs and parameters only */
    const struct relation *relation;
    const double *nominal; /* of each state */

    void (*compare)(const void *values, double t, const struct given *given,
                    struct compared compared[]);
    /* Of each timed relation, s. */
    void (*write_times)(const void *values, double times[]);
    void (*find_due)(const void *values, double t, int due[]);
    /* An event happens: right sides see the values before it; a state that jumps gets tolerance 0.
     */
    void (*change)(void *values, double t, int event, double tolerance[]);
};

/* Memory for one call. */
struct relations_room {
    struct compared *compared, *before; /* one per relation each */
    double *times;                      /* one per relation */
    int *due;                           /* one per event */
    int *turned;                        /* one per relation; zeros */
    double *tolerance;                  /* one per state */
    const double *zeros;                /* one per state and input */
};

/* Functions of struct model_events. */
double relations_next_time(const struct relations *model, struct relations_room room,
                           const void *values);
bool relations_are_plausible(const struct relations *model, const void *values);
enum status relations_update(const struct relations *model, struct relations_room room,
                             void *values, const struct event *event);

/* errors of struct model_events. */
void relations_errors(const struct relations *model, struct relations_room room, const void *values,
                      double t, const double state_errors[], double relative, double errors[]);

/* How far a function y of an argument with an error may be wrong, from its values at the ends of
 * what the argument may be. One that is not defined there does not count. */
static inline double relations_spread(double y, double at_begin, double at_end) {
    return fmax(fabs(at_begin - y), fabs(at_end - y));
}

/* The values whose modes have followed inputs and parameters that were set since the last event:
 * they themselves, or `copy`. */
const void *relations_followed(const struct relations *model, struct relations_room room,
                               const void *values, double t, void *copy);

/* The indicator of a relation whose distance is offset + factor x[state]: the distance where the
 * relation holds, else its negative, so that it falls to 0 where the mode changes. rate: derivative
 * of the state by the time; 0: unknown. */
static inline struct indicator relations_state_indicator(size_t state, int holds, double factor,
                                                         double offset, double rate) {
    const double sign = holds ? 1.0 : -1.0;
    return (struct indicator){.kind = INDICATOR_OF_STATE,
                              .state = state,
                              .factor = sign * factor,
                              .offset = sign * offset,
                              .rises = sign * factor * rate > 0.0};
}

#endif
