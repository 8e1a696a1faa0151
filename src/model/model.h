/* What a model gives to the instance that runs it. A model keeps all its values in one structure
 * made of doubles and ints; the instance reads and writes them through the generated table.
 */
#ifndef MODEL_H
#define MODEL_H

#include "status.h"

#include <stdbool.h>
#include <stddef.h>

/* Parts of the value structure. */
struct range {
    size_t offset; /* bytes from the start of the structure */
    size_t size;   /* bytes */
};

/* ---- Events ---------------------------------------------------------------------------------
 * Modes of a model, and the events at which they change. A model without modes has none of this.
 *
 * Between two events the modes stay as they are, and the right-hand side is smooth. An indicator is
 * above 0 while the modes are valid; a state event is where one falls to 0. A time event comes at a
 * time that is known before. */

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

/* ---- Taylor series -------------------------------------------------------------------------- */

/* Coefficients of a row: orders 0 to SERIES_LENGTH - 1. */
enum { SERIES_LENGTH = 32 };

/* Of an input: inputs are polynomials of degree 3 at most. */
enum { SERIES_INPUT_LENGTH = 4 };

/* Coefficient k of a quantity y is time_scale^k / k! times its k-th derivative by the time, so that
 * y(t + s time_scale) is the sum of y_k s^k; all coefficients have the unit of y. */
struct series_origin {
    const void *values;                          /* value structure, of which parameters are read */
    double t;                                    /* s */
    double time_scale;                           /* s: time scale of the coefficients, > 0 */
    const double (*inputs)[SERIES_INPUT_LENGTH]; /* coefficients of each input */
};

/* The Taylor series of a solution, which a model may offer beside its right-hand side. */
struct series {
    /* Rows that extend writes: the states in their order, then other quantities: what it needs
     * itself, and functions of the motion that others want to follow over a step. It may leave out
     * unused rows. */
    size_t row_count;

    /* Of each event indicator the row that is this indicator while its kind is
     * INDICATOR_OF_MODEL. NULL: rows have no indicators. */
    const size_t *row_of_indicator;

    /* Writes the coefficients of the orders first to last (< SERIES_LENGTH) of all rows, from those
     * of lower orders; first is 0, with the states' coefficients of order 0 given, or follows the
     * last of the call before. The same coefficients, to the bit, however many a call adds. */
    enum status (*extend)(const struct series_origin *origin, int first, int last,
                          double rows[][SERIES_LENGTH]);
};

/* ---- The model ------------------------------------------------------------------------------ */

struct model {
    size_t values_size;       /* bytes of the value structure */
    struct range parameters;  /* all fields that parameters are bound to */
    struct range inputs;      /* double[], all inputs */
    struct range states;      /* double[], all continuous states */
    struct range derivatives; /* double[], time derivative of each state in the order of states; may
                                overlap states */

    /* Writes x' = f(t, x, u, p) to dx. A pure function: parameters are read from values, states and
     * inputs only from x and u. t in s, the rest in the units of variables.toml. */
    enum status (*right_hand_side)(const void *values, double t, const double x[], const double u[],
                                   double dx[]);

    /* Writes the derivatives of f by the states to J: J[i + state_count j] is that of x'_i by x_j,
     * or 0 where x_j rests in these modes. Implicit methods need it. Pure as right_hand_side; NULL
     * if the model has no states. */
    enum status (*jacobian)(const void *values, double t, const double x[], const double u[],
                            double J[]);

    /* The Taylor series of the states; NULL: the model offers none. Only a model whose right-hand
     * side has all derivatives everywhere may offer one. */
    const struct series *series;

    /* Writes all calculated fields of values from its parameters, inputs and states at time t. */
    enum status (*outputs)(void *values, double t);

    /* Derivatives of the calculated fields along a curve in the space of parameters, inputs, states
     * and time. values: a point of the curve, its calculated fields up to date. first, second:
     * value structures whose parameters, inputs and states hold the first and second derivatives of
     * these along the curve; their calculated fields are written. second may be NULL. t in s; dt:
     * the derivative of time along the curve, which is straight in time. */
    enum status (*propagate)(const void *values, double t, double dt, void *first, void *second);

    /* STATUS_OK if the parameters are consistent; otherwise STATUS_INVALID_PARAMETERS and one line
     * in text (size bytes) that says what is wrong and what is expected. */
    enum status (*check_parameters)(const void *values, char *text, size_t size);

    /* NULL: the model has no modes. */
    const struct model_events *events;
};

#endif
