/* Gradients of a run of a model that is made from its equations (fmu/compiler): how the states
 * change with parameters, and with starts of states.
 *
 * Each parameter p has its own copy S of the states, S = dx/dp at a fixed time. Between events S' =
 * J S + f_p. An event at the time T(p) needs the change along with T: S + f T_p, with the rates
 * before it; the new values' derivatives follow from that, and S after it is theirs minus f T_p,
 * with the rates after it. Hiskens and Pai, Trajectory Sensitivity Analysis of Hybrid Systems, IEEE
 * Transactions on Circuits and Systems I 47 (2000), equations (29) to (38).
 *
 * T_p follows from what has caused the event: where a relation g comes to its limit, T_p = -(g_x S
 * + g_p) / (g_x f + g_t + g_u u'); a tick's time is a function of parameters; what happens at the
 * start, or since inputs have jumped, does so at a fixed time. All that follows at the same instant
 * has the same T_p, within a part of the model that others do not read: two equal machines may
 * switch at once, each at its own time. */
#pragma once

#include "model.h"

struct call;

/* How the distance of a relation moves. */
struct crossing {
    double slope;     /* derivative by the time, 1/s */
    double size;      /* sum of the magnitudes of its terms */
    double drift;     /* the part of the slope that time and inputs make */
    double curvature; /* second derivative by the time, 1/s2 */
    bool is_of_input; /* true if inputs take part */
    double *by;       /* derivative by each parameter, at a fixed time */
    double *sizes;    /* of each: sum of the magnitudes of its terms */
};

struct gradients {
    int count;                /* of parameters */
    int state_count;          /* of the model without gradients, which come first */
    size_t are_exact;         /* offset of an int */
    const int *part_of_state; /* number of the part, of those that do not read each other */
    const int *part_of_cause; /* likewise of relations, limits of contacts, samplers */
    const double *size;       /* of a change of each parameter that is not small */
    const char *const *names; /* of relations, then of the limits of contacts */
    int relation_count;       /* those of the model; behind them slopes are compared with 0 */
    const bool *is_kink;      /* of each relation: both sides are equal where it switches */
    const int *watched; /* of each relation: the one whose slope it compares with 0; -1: none */

    /* Writes the rates of the states. */
    void (*rates)(const void *values, double t, double rate[]);
    /* Writes how the distance of a relation, or behind them of a limit of contacts, moves.
     * rate: of the states. */
    void (*cross)(const void *values, double t, const double du[], const double rate[],
                  int relation, struct crossing *to);
    /* Writes derivatives of the time of a sampler's next tick by each parameter. */
    void (*tick)(const void *values, int sampler, double shift[]);

    /* The functions below. FMUs whose model does not name them are linked without them. */
    void (*depart)(const struct call *call, const struct event *event);
    void (*arrive)(const struct call *call, const struct event *event, bool is_start);
};

/* What is known about an event. */
struct departure {
    bool has_departed;
    bool jumps;           /* true if the event has assigned something */
    const char *other[2]; /* two at once in a part, whose times change in different ways */
    const char *doubtful; /* one that another parameter would let vanish */
    const char *missed;   /* one that another parameter would let happen */
    const char *tied;     /* one that begins at its limit, and another parameter would not */
    const char *driven;   /* one that inputs move, whose motion is not known */
};

/* Memory for one call. */
struct gradients_room {
    double *shift;      /* of each part: T_p of each parameter, s by its unit */
    double *noise;      /* of each shift */
    double *rate;       /* two per state */
    double *by;         /* two per parameter */
    double *contacts;   /* what is measured of them, and two per direction */
    const char **cause; /* of each part: the first one; NULL: none yet */
    struct departure *departure;
};

#define GRADIENTS_ROOM(parameters, states, parts, of_contacts)                                     \
    (struct gradients_room) {                                                                      \
        (double[(parts) * (parameters)]){0}, (double[(parts) * (parameters)]){0},                  \
            (double[2 * (states) + 1]){0}, (double[2 * (parameters)]){0},                          \
            (double[(of_contacts) + 1]){0}, (const char *[parts]){NULL}, &(struct departure) {     \
            0                                                                                      \
        }                                                                                          \
    }

/* Finds what causes the event, from relations in `turned` and time events, and lets the gradients
 * move with its time. Modes and values are those before the event. */
void gradients_depart(const struct call *call, const struct event *event);

/* Returns the gradients to a fixed time, with the modes and values after the event. Writes why they
 * are not exact. is_start: at the end of the initialization. */
void gradients_arrive(const struct call *call, const struct event *event, bool is_start);
