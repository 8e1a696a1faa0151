/* What a model gives to the slave that runs it. A model keeps all its values in one structure of
 * its own, made of doubles and ints; the slave reads and writes them through the generated table.
 */
#ifndef MODEL_H
#define MODEL_H

#include "status.h"

#include <stddef.h>

/* A part of the value structure. */
struct span {
    size_t offset; /* bytes from the start of the structure */
    size_t size;   /* bytes */
};

struct model {
    size_t values_size;     /* bytes of the value structure */
    struct span parameters; /* all fields that parameters are bound to */
    struct span inputs;     /* double[], all inputs */
    struct span states;     /* double[], all continuous states */

    /* Writes x' = f(t, x, u, p) to dx. A pure function: parameters are read from values, states and
     * inputs from x and u alone. t in s, the rest in the units of variables.toml. */
    enum status (*derivatives)(const void *values, double t, const double x[], const double u[],
                               double dx[]);

    /* Writes all calculated fields of values from its parameters, inputs and states at time t. */
    enum status (*outputs)(void *values, double t);

    /* STATUS_OK where the parameters go together; otherwise STATUS_INVALID_PARAMETERS with one line
     * in text (size bytes) that says what is wrong and what is expected. */
    enum status (*check_parameters)(const void *values, char *text, size_t size);
};

#endif
