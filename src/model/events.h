/* Modes of a model, and the events at which they change. A model without modes has none of this.
 *
 * Between two events the modes stay as they are, and the right-hand side is smooth. An indicator is
 * above 0 while the modes are valid; a state event is where one falls to 0. A time event comes at a
 * time that is known before. */
#ifndef EVENTS_H
#define EVENTS_H

#include "status.h"

#include <stdbool.h>
#include <stddef.h>

/* Parts of the value structure. */
struct range {
    size_t offset; /* bytes from the start of the structure */
    size_t size;   /* bytes */
};

/* How an indicator follows from states and inputs while the modes stay as they are. */
enum indicator_kind {
    INDICATOR_UNUSED,   /* above 0 whatever states and inputs are */
    INDICATOR_OF_STATE, /* offset + factor x[state] */
    INDICATOR_OF_MODEL, /* what struct model_events' indicators writes: smooth in t, x and u */
};

struct indicator {
    enum indicator_kind kind;
    /* of INDICATOR_OF_STATE */
    size_t state;
    double factor;
    double offset; /* of INDICATOR_OF_MODEL: the size of the limit that it is the distance to, from
                      which its error follows where the model has no `errors` */
    bool rises;    /* of INDICATOR_OF_STATE: it may be 0 now, and its slope is above 0 */
};

struct event {
    double t;                /* s */
    const bool *triggered;   /* one per indicator: it falls to 0 here. NULL: there is no event;
                            inputs or parameters have changed, or the initialization ends */
    bool is_timed;           /* the time that next_time gave has come */
    const double *du;        /* derivative of each input by the time after the event */
    bool du_is_known;        /* else 0: of inputs that move outside */
    const double *tolerance; /* of each state, in its unit: relative part and absolute one */
    int max_events;          /* events may follow each other so many times at one instant */
    char *reason;            /* one line, reason_size bytes: why update fails. NULL: nobody asks */
    size_t reason_size;
};

/* s: the shortest period of time events about the time t (s). With fewer than 4096 doubles between
 * two of them the events would be irregular. */
static inline double event_shortest_period(double t) {
    return 0x1p-40 * (t < 0.0 ? -t : t);
}

/* A model without indicators has NULL for all that belongs to them. */
struct model_events {
    size_t indicator_count;
    const char *const *indicator_names;
    struct range modes;           /* int[]: the right-hand side reads them, only update writes them.
                                    Zeros until the initialization ends */
    struct range discrete_states; /* double[]: sums over events, samples; as modes */
    struct range discrete_inputs; /* int[]: Boolean inputs */

    /* Time of the next time event, s; INFINITY: there is none. It follows from parameters, modes
     * and discrete states, and moves on with update. NULL: the model has no time events. */
    double (*next_time)(const void *values);

    /* Whether there can be state events with these parameters. If not, update writes the modes in
     * which the right-hand side is smooth everywhere. */
    bool (*are_possible)(const void *values);

    /* Whether update can have left these modes: those of a saved state may be anything. is_held:
     * parameters and states are still those that it left with them; otherwise some may have been
     * set since. */
    bool (*modes_are_possible)(const void *values, bool is_held);

    /* In these modes no state moves, whatever the inputs are. NULL: of a model without states. */
    bool (*is_at_rest)(const void *values);

    /* Writes the kind of each indicator in these modes. */
    void (*describe)(const void *values, struct indicator indicators[]);

    /* Writes all indicators; 1 for unused ones. Pure as right_hand_side: parameters and modes are
     * read from values, states and inputs from x and u. */
    enum status (*indicators)(const void *values, double t, const double x[], const double u[],
                              double z[]);

    /* Writes by how much each indicator of the model may be wrong where the states have these
     * errors (in their units), the time and the inputs the relative error `relative`, and where all
     * operations are rounded; 0 where that is not known, as close to where one is not finite. NULL:
     * errors follow from the limits that describe gives. */
    void (*errors)(const void *values, double t, const double state_errors[], double relative,
                   double errors[]);

    /* Writes how far each state may move from x within one internal step, INFINITY for any way: on
     * a longer one the right-hand side could change and change back between the points at which it
     * is evaluated. NULL: any way. */
    void (*reach)(const void *values, const double x[], double reach[]);

    /* Writes the modes, states and discrete states that follow an event, from all that is set:
     * parameters, inputs, states, modes. Where there is no event, a second call changes nothing. */
    enum status (*update)(void *values, const struct event *event);
};

#endif
