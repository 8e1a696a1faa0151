/* The linear solver of SUNDIALS for a band. Only a model with a band names it: others are linked
 * without it. */
#include "sundials.h"

#include "workspace.h"

#include <sunlinsol/sunlinsol_band.h>
#include <sunmatrix/sunmatrix_band.h>

static SUNMatrix create_matrix(const struct band *band, sunindextype n, SUNContext context) {
    return SUNBandMatrix(n, (sunindextype)band->upper, (sunindextype)band->lower, context);
}

/* The matrix has the states in the order of the band. */
struct banded {
    struct _SUNLinearSolverContent_Band base; /* first */
    const size_t *order;
};

/* Writes x; b may change, too. */
static int solve_in_order(SUNLinearSolver solver, SUNMatrix A, N_Vector x, N_Vector b,
                          sunrealtype tolerance) {
    const size_t *order = ((const struct banded *)solver->content)->order;
    const sunindextype n = SM_COLUMNS_B(A);
    for (sunindextype k = 0; k < n; k++) {
        small_vector_data(x)[k] = small_vector_data(b)[order[k]];
    }
    const int flag = SUNLinSolSolve_Band(solver, A, x, x, tolerance);
    for (sunindextype k = 0; k < n; k++) {
        small_vector_data(b)[order[k]] = small_vector_data(x)[k];
    }
    N_VScale(1.0, b, x);
    return flag;
}

static SUNLinearSolver create(const struct band *band, N_Vector pattern, SUNMatrix A) {
    struct banded *own = workspace_calloc(1, sizeof *own);
    SUNLinearSolver solver = own != NULL ? SUNLinSol_Band(pattern, A, pattern->sunctx) : NULL;
    if (solver != NULL) {
        own->base = *(SUNLinearSolverContent_Band)solver->content;
        own->order = band->order;
        solver->content = own;
        solver->ops->solve = solve_in_order;
    }
    return solver;
}

const struct band_solver integrator_band_solver = {create_matrix, create};
