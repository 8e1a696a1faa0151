/* An N_Vector of SUNDIALS for few doubles: one block of memory per vector, a table of operations
 * shared by all, loops whose length the compiler knows if it is 2 or 4. N_VNew_Serial does the same
 * at any length and several times the cost per operation.
 *
 * It has the operations that every integrator of SUNDIALS needs and the fused ones of CVODE and
 * ARKODE; sums are formed in the same order as in N_Vector_Serial. Private to the integrator. */
#pragma once

#include <stdbool.h>

#include <sundials/sundials_nvector.h>

/* Terms of a linear combination: see small_vector_note_terms. */
enum { SMALL_VECTOR_MOST_TERMS = 16 };
struct small_vector_terms {
    bool replace_sum; /* true if x need not be written */
    int count;        /* 0 if there are none, or more than there is room for */
    const double *data[SMALL_VECTOR_MOST_TERMS];
};

/* Creates a vector of length (> 0) zeros; NULL if memory is short. Vectors cloned from it are zeros
 * too. N_VDestroy frees each. */
N_Vector small_vector_create(sunindextype length, SUNContext context);

/* Returns the elements of a vector made by small_vector_create or a clone. */
static inline double *small_vector_data(N_Vector vector) {
    return (double *)vector->content;
}

/* Makes N_VLinearCombination with the result x note the data of its terms from now on, in their
 * order. terms NULL: no longer. */
void small_vector_note_terms(N_Vector x, struct small_vector_terms *terms);

/* Writes x = sum of data[k] s^(count - 1 - k), length elements: the terms are the coefficients of a
 * polynomial, beginning with the highest power. count > 0. */
void small_vector_polynomial(const struct small_vector_terms *terms, double s, size_t length,
                             double x[]);
