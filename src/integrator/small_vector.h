/* An N_Vector of SUNDIALS for few doubles: one block of memory per vector, a table of operations
 * shared by all, loops whose length the compiler knows where it is 2 or 4. N_VNew_Serial does
 * the same at any length and several times the cost per operation.
 *
 * Beyond what every integrator of SUNDIALS asks for it has the fused operations that CVODE and
 * ARKODE use; sums are formed in the order in which N_Vector_Serial forms them. Private to the
 * integrator. */
#ifndef SMALL_VECTOR_H
#define SMALL_VECTOR_H

#include <sundials/sundials_nvector.h>

/* The terms of a linear combination: see small_vector_note_terms. */
enum { SMALL_VECTOR_MOST_TERMS = 16 };
struct small_vector_terms {
    int count; /* 0: none, or more than there is room for */
    const double *data[SMALL_VECTOR_MOST_TERMS];
};

/* A vector of length (> 0) zeros, or NULL where memory is short. Vectors cloned from it are zeros
 * too. N_VDestroy frees each. */
N_Vector small_vector_create(sunindextype length, SUNContext context);

/* The elements of a vector that small_vector_create or a clone made. */
static inline double *small_vector_data(N_Vector vector) {
    return (double *)vector->content;
}

/* From now on N_VLinearCombination with the result x notes the data of its terms, in their order.
 * terms NULL: no longer. */
void small_vector_note_terms(N_Vector x, struct small_vector_terms *terms);

/* x = sum of data[k] s^(count - 1 - k), length elements: the terms as the coefficients of a
 * polynomial, that of the highest power first. count > 0. */
void small_vector_polynomial(const struct small_vector_terms *terms, double s, size_t length,
                             double x[]);

#endif
