/* A linear solver of SUNDIALS for states with their gradients. The Newton matrix of all is taken
 * for block diagonal, with the matrix of the states in each block: what the gradients' derivatives
 * depend on the states for is left to the next iteration. So one factorization serves them all. */
#include "sundials.h"

#include "workspace.h"

struct columns {
    SUNLinearSolver solver; /* of one block */
    N_Vector x, b;          /* views of one block: their own data are not used */
};

static SUNLinearSolver_Type type(SUNLinearSolver solver) {
    return SUNLINEARSOLVER_DIRECT;
}

static int setup(SUNLinearSolver solver, SUNMatrix A) {
    return SUNLinSolSetup(((const struct columns *)solver->content)->solver, A);
}

/* Writes x; b may change, too. */
static int solve(SUNLinearSolver solver, SUNMatrix A, N_Vector x, N_Vector b,
                 sunrealtype tolerance) {
    const struct columns *columns = solver->content;
    const sunindextype n = N_VGetLength(columns->x);
    int flag = SUNLS_SUCCESS;
    for (sunindextype begin = 0; begin < N_VGetLength(x) && flag == SUNLS_SUCCESS; begin += n) {
        columns->x->content = small_vector_data(x) + begin;
        columns->b->content = small_vector_data(b) + begin;
        flag = SUNLinSolSolve(columns->solver, A, columns->x, columns->b, tolerance);
    }
    return flag;
}

static int destroy(SUNLinearSolver solver) {
    const struct columns *columns = solver->content;
    if (columns != NULL) {
        SUNLinSolFree(columns->solver);
        N_VDestroy(columns->x);
        N_VDestroy(columns->b);
        workspace_free(solver->content);
        solver->content = NULL;
    }
    SUNLinSolFreeEmpty(solver);
    return SUNLS_SUCCESS;
}

SUNLinearSolver sundials_column_solver(SUNLinearSolver of_column, sunindextype n) {
    SUNContext context = of_column->sunctx;
    struct columns *columns = workspace_calloc(1, sizeof *columns);
    SUNLinearSolver solver = columns != NULL ? SUNLinSolNewEmpty(context) : NULL;
    if (solver == NULL || (columns->x = small_vector_create(n, context)) == NULL ||
        (columns->b = small_vector_create(n, context)) == NULL) {
        SUNLinSolFree(of_column);
        return NULL;
    }
    columns->solver = of_column;
    solver->content = columns;
    solver->ops->gettype = type;
    solver->ops->setup = setup;
    solver->ops->solve = solve;
    solver->ops->free = destroy;
    return solver;
}
