/* Context, vectors, texts and status that the methods of SUNDIALS share. */
#pragma once

#include "method.h"
#include "small_vector.h"

#include <sundials/sundials_context.h>
#include <sundials/sundials_linearsolver.h>

/* First member of each method's memory, and user data of its solver. */
struct sundials {
    struct problem *problem;
    const struct method *method;
    SUNContext context;
    N_Vector x;
    N_Vector absolute_tolerances;
    N_Vector work;
};

/* Creates the Jacobian of n states and its solver, for which pattern is a serial vector; NULL if
 * memory is short. */
struct band_solver {
    SUNMatrix (*create_matrix)(const struct band *band, sunindextype n, SUNContext context);
    SUNLinearSolver (*create)(const struct band *band, N_Vector pattern, SUNMatrix A);
};

/* Returns a solver of all columns of n elements of a vector with the solver of one column, which it
 * owns; NULL if memory is short. */
MUST_CHECK NONNULL SUNLinearSolver sundials_column_solver(SUNLinearSolver of_column,
                                                          sunindextype n);

/* Returns the number of bytes for the context and the largest method, the one with matrices. */
size_t sundials_memory_size(const struct ode *ode);

/* Allocates memory of size bytes that begins with a struct sundials, with the context and the
 * vectors in it. Returns NULL if memory is short. */
MUST_CHECK NONNULL void *sundials_create(size_t size, struct problem *problem,
                                         const struct method *method);

/* Frees the memory itself too; the solver must be freed before. A half-built one is allowed. */
NONNULL void sundials_destroy(void *memory);

/* Returns the status of a flag of CVODE or ARKODE: they use the same numbers. */
MUST_CHECK NONNULL enum status sundials_status(const struct problem *problem, int flag);

/* Receives the texts of a solver; user data: struct sundials. */
void sundials_text(int error_code, const char *module, const char *function, char *text,
                   void *sundials_pointer);

/* Evaluates the right-hand side for SUNDIALS; user data: struct sundials. */
int sundials_rhs(sunrealtype t, N_Vector x, N_Vector dx, void *user_data);

/* Returns the flag of a callback: 1 if the evaluation failed, so that a smaller step is tried. */
int sundials_callback_flag(enum status status);

/* The first message of an advance, which is sent if the advance fails in the end; text: "" if there
 * is none yet. */
struct sundials_message {
    enum status status;
    char text[512];
};

/* Keeps a message unless there is one; a message_sink's write. */
void sundials_keep_message(void *kept, enum status status, const char *text);

/* Converts a number of steps to a long, which has 32 bits on some platforms. */
long sundials_steps(int64_t count);

/* Copy the state to or from the vector; x may be the vector's own array. */
NONNULL void sundials_set_state(struct sundials *sundials, const double x[]);
NONNULL void sundials_get_state(const struct sundials *sundials, double x[]);

/* Integrates x' = 0 with the method of memory: solvers allocate memory at their first step. */
MUST_CHECK NONNULL enum status sundials_warm_up(void *memory);
