/* What a model gives to the instance that runs it. A model keeps all its values in one structure
 * made of doubles and ints; the instance reads and writes them through the generated table.
 */
#ifndef MODEL_H
#define MODEL_H

#include "events.h"
#include "series.h"
#include "status.h"

#include <stddef.h>

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
