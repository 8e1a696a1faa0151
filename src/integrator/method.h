/* Inside of the integrator, shared by integrator.c and the files of its methods. The only header
 * with types of SUNDIALS beside sundials_compat.h and small_vector.h. */
#ifndef INTEGRATOR_METHOD_INTERNALS_H
#define INTEGRATOR_METHOD_INTERNALS_H

#include "integrator.h"
#include "reserve.h"
#include "small_vector.h"
#include "sundials_compat.h"

#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_matrix.h>
#include <sundials/sundials_nonlinearsolver.h>

struct integrator {
    struct ode ode;
    struct message_sink sink;
    struct sundials_texts texts;
    struct reserve reserve;              /* for context, vectors and solver */
    size_t without_method;               /* bytes of it */
    struct integrator_settings settings; /* without the tolerances of the states */

    const struct method *method; /* NULL before integrator_configure */
    SUNContext context;
    void *solver; /* of CVODE or ERKStep */
    SUNNonlinearSolver nonlinear_solver;
    SUNMatrix jacobian;
    SUNLinearSolver linear_solver;
    N_Vector x;
    N_Vector last_x; /* state at reached */
    N_Vector absolute_tolerances;
    N_Vector work;
    struct small_vector_terms columns; /* of the last internal step; count 0: not known yet */

    // times in s since the restart
    double span;       /* internal steps must not pass it */
    double reached;    /* where the last advance ended */
    double failed_at;  /* the last time that the right-hand side failed at */
    double internal;   /* where the last internal step ended; -INFINITY before the first */
    double first_step; /* s: of the next restart or, with no history, advance; 0: unknown */

    struct integrator_statistics statistics;
    struct integrator_statistics counted; /* what the solver, which counts from the last restart on,
                                             had counted when statistics was brought up to date */
};

/* What a file of a method gives. Functions that return an int return a flag of the solver. */
struct method {
    bool has_history;
    const char *name; /* of the solver, in texts */

    /* Allocates all but the context and the vectors of struct integrator. */
    enum status (*create)(struct integrator *integrator);
    void (*destroy)(struct integrator *integrator);

    /* Settings and tolerances of the integrator become those of the solver. */
    int (*configure)(struct integrator *integrator);

    /* From x at time 0. */
    int (*restart)(struct integrator *integrator);

    /* Integrates from reached to t, with the state in x; *stopped_at is where it came to. */
    int (*advance)(struct integrator *integrator, double t, long max_steps, double *stopped_at);

    /* Estimates first_step from where the solver is. */
    double (*next_step)(const struct integrator *integrator);

    /* Steps, failed steps, last step and its order since the last restart; time of the solver. */
    void (*count)(const struct integrator *integrator, struct integrator_statistics *now);
    double (*internal_time)(const struct integrator *integrator);

    /* Writes the state at t, between the last two internal steps, to x; false where it cannot. NULL
     * with no history. */
    bool (*interpolate)(struct integrator *integrator, double t);

    enum status (*status_of_flag)(const struct integrator *integrator, int flag);
};

extern const struct method integrator_cvode_adams;
extern const struct method integrator_cvode_bdf;
extern const struct method integrator_erk;

/* The right-hand side as SUNDIALS calls it; user data: the integrator. */
int integrator_evaluate_rhs(sunrealtype t, N_Vector x, N_Vector dx, void *integrator);

/* Stuck in front of a time that the right-hand side cannot be evaluated at. */
static inline bool integrator_is_stuck(const struct integrator *integrator) {
    return integrator->failed_at >= integrator->reached;
}

/* All values are finite: 0 x is 0 for those alone. */
static inline bool integrator_are_finite(const double values[], size_t count) {
    double sum = 0.0;
    for (size_t i = 0; i < count; i++) {
        sum += 0.0 * values[i];
    }
    return sum == 0.0;
}

#endif
