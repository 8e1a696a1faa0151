/* The modes of the relations of a model, within one call of relations.h. */
#pragma once

#include "relations.h"

#include <math.h>

#define MODES_TIME_ERROR 1e-12 /* relative error of the time of an event */

/* Arguments of all functions during one event: a model, its values, and memory. */
struct call {
    const struct relations *model;
    struct relations_room room;
    void *values;
    int *is_begun, *holds, *active, *segments; /* parts of its modes */
    int relation_count;                        /* 0 if no relation is read */
    double t;                                  /* s */
    double error;                              /* of t, s */
    double passed;                /* s: earlier time events, and those at this time, are past */
    const double *du;             /* derivative of each input by the time */
    const double *largest_inputs; /* as in struct event */
};

/* Bits of room.turned. */
enum {
    TURNED = 1,  /* keeps its mode */
    FOLLOWS = 2, /* a mode that follow_solutions changes */
    RISEN = 4,   /* an event has made it hold */
    FALLEN = 8,  /* an event has ended it */
};

static inline bool modes_hold_at(const struct relation *relation, double distance) {
    return relation->includes_zero ? distance >= 0.0 : distance > 0.0;
}

/* True if the relation is at its limit, within its noise. */
static inline bool modes_near(const struct compared *compared) {
    return fabs(compared->distance) <= compared->noise;
}

/* Returns the slope of the distance with the sign of the mode. */
static inline double modes_slope(const struct compared *compared, int holds) {
    return holds ? compared->slope : -compared->slope;
}

/* True if the distance tells which mode is right. Without a reader the distance may be NaN, and
 * counts. */
static inline bool modes_sure(const struct compared *compared) {
    const double size = fabs(compared->distance);
    return compared->used ? size >= compared->noise : !(size < compared->noise);
}

/* Returns the arguments of a call at t. du: derivatives of the inputs; largest_inputs: as in struct
 * event. */
struct call modes_call(const struct relations *model, struct relations_room room, void *values,
                       double t, const double du[], const double largest_inputs[]);

/* Compares all relations. state_errors: how far from its limit each state may have been located, in
 * its unit. */
void modes_compare(const struct call *call, const double state_errors[],
                   struct compared compared[]);

/* Compares the limits of all contacts, two of each. */
void modes_compare_limits(const struct call *call, struct compared compared[]);

/* Updates all modes at an event. Where one value jumps, others may come to their limits. True if
 * some may have changed. */
bool modes_settle(const struct call *call);

/* Updates modes until none changes. is_exact: distances are exact to the last bit. True if some may
 * have changed. */
bool modes_update(const struct call *call, bool is_exact);

/* Writes the modes that follow from inputs only, each after those that its relation reads. */
void modes_follow_inputs(const struct call *call);

/* Writes the modes that follow from the values, whatever they were before. */
void modes_begin(const struct call *call);

/* Switches relations after an event has changed values: a relation at its limit that now falls
 * switches, or its next event would be due at once; a relation that the event has placed at its
 * limit, at rest, holds if it includes zero, as does one that nothing has read before. The motion
 * of inputs may not be known, but it is part of the slopes before and after the change.
 *
 * call->room.before: the relations before the change. */
void modes_switch_fallen(const struct call *call);

/* True if the next tick of a sampler, at the time *tick, is at the time t (s) or before. Times that
 * differ only by rounding, such as 3 0.1 and 1 0.3, are one instant. */
bool relations_is_due(const struct call *call, int sampler, double t, double *tick);

/* Clears room.turned. */
void modes_clear_turned(const struct call *call);

/* Returns a relation in a circle that is contradicted whether it holds or not; -1 if there is none.
 */
int modes_contradiction(const struct call *call);
