/* The Taylor series of a solution, which a model may offer beside its right-hand side. */
#ifndef SERIES_H
#define SERIES_H

#include "status.h"

#include <stddef.h>

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

struct series {
    /* Rows that extend writes: the states in their order, then other quantities: what it needs
     * itself, and functions of the motion that others want to follow over a step. It may leave out
     * unused rows. */
    size_t row_count;

    /* Of each event indicator (events.h) the row that is this indicator while its kind is
     * INDICATOR_OF_MODEL. NULL: rows have no indicators. */
    const size_t *row_of_indicator;

    /* Writes the coefficients of the orders first to last (< SERIES_LENGTH) of all rows, from those
     * of lower orders; first is 0, with the states' coefficients of order 0 given, or follows the
     * last of the call before. The same coefficients, to the bit, however many a call adds. */
    enum status (*extend)(const struct series_origin *origin, int first, int last,
                          double rows[][SERIES_LENGTH]);
};

#endif
