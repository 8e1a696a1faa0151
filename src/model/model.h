/* Interface of a model for the instance that runs it. A model keeps all its values in one structure
 * made of doubles and ints; the instance reads and writes them through the generated table. */
#pragma once

#include "status.h"

#include <limits.h>
#include <stdbool.h>
#include <stddef.h>

/* A part of the value structure. */
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

/* Kind of an indicator: how it follows from states and inputs while the modes stay the same. */
enum indicator_kind {
    INDICATOR_UNUSED,   /* above 0 whatever states and inputs are */
    INDICATOR_OF_STATE, /* offset + factor x[state] */
    INDICATOR_OF_MODEL, /* written by `indicators` of struct model_events: smooth in t, x and u */
};

struct indicator {
    enum indicator_kind kind;
    /* of INDICATOR_OF_STATE */
    size_t state;
    double factor;
    double offset;       /* of INDICATOR_OF_MODEL: size of the limit from which the indicator is the
                            distance; its error follows from it if the model has no `errors` */
    bool rises;          /* of INDICATOR_OF_STATE: it may be 0 now, but its slope is above 0 */
    double is_far_above; /* of INDICATOR_OF_MODEL: far above its error, from here on; 0: unknown */
};

struct event {
    double t; /* s */
    /* Per indicator, true if it falls to 0 here. NULL if there is no event: inputs or parameters
     * have changed, or the initialization ends. */
    const bool *triggered;
    bool is_timed;                /* true at the time that next_time returned */
    const double *du;             /* derivative of each input by the time after the event */
    const double *largest_inputs; /* magnitudes so far; NULL if the inputs do not move */
    bool du_is_known;             /* false if inputs move outside: du is 0 then */
    /* Tolerance of each state, in its unit: sum of its relative and absolute tolerance. */
    const double *tolerance;
    double rest; /* motion within max(rest, 1) of these may end at a limit */
    /* Where update writes the text of the expression that is not finite, if it fails for that. */
    const char **text;
    int max_events; /* largest number of events that follow each other at one instant */
    char *reason; /* room for one line of reason_size bytes: update writes why it fails. NULL if the
                     caller does not read it */
    size_t reason_size;
    char *note; /* likewise, empty: update writes what the user should know about gradients */
    size_t note_size;
};

/* Returns the shortest period (s) of time events about the time t (s). With fewer than 4096 doubles
 * between two events these would be irregular. */
static inline double event_shortest_period(double t) {
    return 0x1p-40 * (t < 0.0 ? -t : t);
}

/* Functions of a model that has events. Without indicators, every pointer about them is NULL. */
struct model_events {
    size_t indicator_count;
    const char *const *indicator_names;
    struct range modes; /* int[]: the right-hand side reads them, only update writes them. 0 until
                           the initialization ends */
    struct range discrete_states; /* double[]: sums over events, samples; written like modes, except
                                     those that are variables with start values */
    struct range discrete_inputs; /* int[]: Boolean inputs */
    bool starts_follow; /* true if start values of states may be calculated: the first update writes
                           these states */

    /* Returns the time of the next time event, s, or INFINITY if there is none. It depends on
     * parameters, modes and discrete states, and becomes later by update. NULL if the model has no
     * time events. */
    double (*next_time)(const void *values);

    /* True if state events are possible with these parameters. If not, update writes the modes in
     * which the right-hand side is smooth everywhere. */
    bool (*are_possible)(const void *values);

    /* True if update can have written these modes; the modes of a saved state may be anything.
     * is_held: parameters and states have not been set since the update. */
    bool (*modes_are_possible)(const void *values, bool is_held);

    /* True if update would change nothing, since no event has come, and describe would write the
     * same as after the last update. False or NULL if not known. */
    bool (*moves_on)(const void *values);

    /* True if every state's derivative is 0 in these modes, whatever the inputs are: nothing is
     * integrated then, and no indicator is followed. NULL if the model has no states. */
    bool (*is_at_rest)(const void *values);

    /* Writes the kind of each indicator in these modes. */
    void (*describe)(const void *values, struct indicator indicators[]);

    /* Writes all indicators, 1 for unused ones. A pure function like right_hand_side: parameters
     * and modes are read from values, states and inputs from x and u. */
    enum status (*indicators)(const void *values, double t, const double x[], const double u[],
                              double z[]);

    /* Writes a bound of each indicator's error, if the states have these errors (in their units),
     * the time and the inputs the relative error `relative`, and all operations are rounded; an
     * input's error is relative to its largest magnitude so far, largest_inputs, too. Writes 0
     * where the error is not known, as near values that are not finite. NULL if errors follow from
     * the limits that describe gives. */
    void (*errors)(const void *values, double t, const double state_errors[],
                   const double largest_inputs[], double relative, double errors[]);

    /* Writes how far each state may move from x within one internal step, INFINITY for any
     * distance: in a longer step the right-hand side could change and change back between the
     * points at which it is evaluated. NULL if any distance is allowed. */
    void (*reach)(const void *values, const double x[], double reach[]);

    /* Writes the modes, states and discrete states after an event, from all values that are set:
     * parameters, inputs, states, modes. If there is no event, a second call changes nothing. */
    enum status (*update)(void *values, const struct event *event);

    /* Returns "NAME = expression" of an event's condition that has no value now, beyond all events
     * that have come; NULL if all have one. NULL if none can miss it. */
    const char *(*undefined)(const void *values, double t);

    /* True if an event has ended the simulation: its name and reason go to text (size bytes) as one
     * line. NULL if no event does so. */
    bool (*has_ended)(const void *values, double t, char *text, size_t size);
};

/* ---- Taylor series -------------------------------------------------------------------------- */

/* Number of coefficients in a row: orders 0 to SERIES_LENGTH - 1. */
enum { SERIES_LENGTH = 32 };

/* Number of coefficients of an input: inputs are polynomials of degree 3 at most. */
enum { SERIES_INPUT_LENGTH = 4 };

/* Point about which a series is expanded.
 *
 * Coefficient k of a quantity y is time_scale^k / k! times its k-th derivative by the time, so that
 * y(t + s time_scale) is the sum of y_k s^k; all coefficients have the unit of y. */
struct series_origin {
    const void *values;                          /* value structure with the parameters */
    double t;                                    /* s */
    double time_scale;                           /* time scale of the coefficients, > 0, s */
    const double (*inputs)[SERIES_INPUT_LENGTH]; /* coefficients of each input */
    bool has_avx2;                               /* the processor has it: the same bits, faster */
};

/* A function or quotient that a state follows from: coefficient k is
 * (&rows[0][0])[place + k inner_stride]; likewise of its argument or divisor. */
struct series_inner {
    size_t place, argument;
};

/* The Taylor series of a solution, which a model may offer beside its right-hand side. */
struct series {
    /* Number of rows that extend writes: first the states in their order, then quantities that it
     * needs itself, and functions of the motion that callers follow over a step. It may leave out
     * unused rows. */
    size_t row_count;

    /* Row of each event indicator while its kind is INDICATOR_OF_MODEL. NULL if rows have no
     * indicators. */
    const size_t *row_of_indicator;

    /* Writes the coefficients of the orders first to last (< SERIES_LENGTH) of all rows, from lower
     * orders. first is 0, with the states' coefficients of order 0 given, or follows the last of
     * the call before, or is 1 after a call for another time scale that began with 0. The
     * coefficients do not depend, to the bit, on how many a call adds. */
    enum status (*extend)(const struct series_origin *origin, int first, int last,
                          double rows[][SERIES_LENGTH]);

    /* True if extend reads has_avx2: a virtual machine takes tens of microseconds to answer. */
    bool asks_for_avx2;

    bool may_vanish; /* all terms of a state may be 0, though it does not rest: (t (1 - t))^5 */
    bool is_of_time; /* a derivative follows from the time itself */

    /* What may be nothing at the begin of a step and large within. NULL if there is nothing. */
    const struct series_inner *inner;
    size_t inner_count, inner_stride;

    /* Rows of solutions of equations, which another solution may replace where a step ends, and the
     * nominal values of these. */
    const size_t *solutions;
    const double *solution_sizes;
    size_t solution_count;
};

/* ---- Jacobian ------------------------------------------------------------------------------- */

/* Order of the states in which all elements of a Jacobian are close to its diagonal. */
struct band {
    size_t lower, upper; /* number of diagonals below and above the main one */
    const size_t *order; /* state at each place */
    const struct band_solver *solver;
};

/* Of all bands. FMUs whose model does not name it are linked without it. */
extern const struct band_solver integrator_band_solver;

/* ---- Texts ---------------------------------------------------------------------------------- */

/* A calculated int whose expression has no value, or none that an int holds. */
#define MODEL_NO_INT INT_MIN

/* An expression of the file from which a model is made, for messages about its value. */
struct expression {
    size_t offset; /* of the double or int of the value structure that gets its value */
    const char *text;
};

/* How solutions of equations are searched. */
enum model_search {
    SEARCH_NEAR, /* only those near the anchors count, as for the right-hand side and the other pure
                    functions */
    SEARCH_FAR,
    SEARCH_FREE, /* in the modes that follow from the solutions */
};

/* ---- The model ------------------------------------------------------------------------------ */

struct model {
    size_t values_size;      /* bytes of the value structure */
    struct range parameters; /* all fields that parameters are bound to */
    struct range inputs;     /* double[], all inputs */
    struct range states;     /* double[], all continuous states */
    struct range dx; /* double[], time derivatives of the states in their order; may overlap */

    /* Writes x' = f(t, x, u, p) to dx. A pure function: parameters are read from values, states and
     * inputs only from x and u. t in s, the rest in the units of its variables. */
    enum status (*right_hand_side)(const void *values, double t, const double x[], const double u[],
                                   double dx[]);

    /* Writes the Jacobian: J[i + state_count j] is the derivative of x'_i by x_j, or 0 if x_j rests
     * in these modes. Implicit methods need it. A pure function like right_hand_side. NULL if the
     * model has no states. With a band, of the states at the places i and j, where it is not 0:
     * J[lower + upper + i - j + (2 lower + upper + 1) j], which leaves room to factorize. */
    enum status (*jacobian)(const void *values, double t, const double x[], const double u[],
                            double J[]);
    const struct band *band; /* NULL: of the full Jacobian */

    /* Number of parameters by which the gradients of the states are states, too: behind the states
     * follows a copy of them for each. All copies have the Jacobian of the states, which is all
     * that jacobian writes; their derivatives by the states may be anything. */
    size_t gradient_count;

    /* Taylor series of the states. NULL if the model offers none: only a model whose right-hand
     * side has all derivatives everywhere may offer one. */
    const struct series *series;

    /* Writes all calculated fields of values from its parameters, inputs and states at time t. */
    enum status (*outputs)(void *values, double t);

    /* Writes derivatives of the calculated fields along a curve in the space of parameters, inputs,
     * states and time. values: a point of the curve, its calculated fields up to date. first,
     * second: value structures whose parameters, inputs and states hold the first and second
     * derivatives along the curve; their calculated fields are written. second may be NULL;
     * if it is not, parameters rest along the curve. t in s; dt: derivative of the time along the
     * curve, which is straight in time. */
    enum status (*derivatives)(const void *values, double t, double dt, void *first, void *second);

    /* Returns STATUS_OK if the parameters are consistent; otherwise STATUS_INVALID_PARAMETERS and,
     * in text (size bytes), one line that says what is wrong and what is expected. */
    enum status (*check_parameters)(const void *values, char *text, size_t size);

    /* NULL if the model has no modes. */
    const struct model_events *events;

    /* Where solutions of equations are searched: double[], unknowns at an earlier point, and behind
     * them as many that belong to the instance. */
    struct range anchors;

    /* Writes to anchors the solutions at t, x and u, searched from the anchors in values; where
     * there is none, these. NULL if there are no anchors. */
    void (*anchor)(const void *values, double t, const double x[], const double u[],
                   enum model_search search, double anchors[]);

    /* Writes one line that says which equations have no solution with the values that are set, to
     * text (size bytes). Returns false if all have one. NULL if none need each other. */
    bool (*explain)(const void *values, double t, char *text, size_t size);

    /* Expressions of calculated fields; NULL if the model has no file. */
    const struct expression *expressions;
    size_t expression_count;
};
